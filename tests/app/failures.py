"""Processes that compute as they should not; see `app.compute.process_main.serve`."""

from __future__ import annotations

from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numba

from app.compute.process_main import REPORT_INTERVAL, serve
from symgrasp.feasibility.create import MapMaker


def serve_broken(pipe: Connection, folders: tuple[Path, ...]) -> None:
    """Raise from every map something that cannot be pickled."""

    class Strange(Exception):
        pass

    def broken(*_: Any, **__: Any) -> None:
        raise Strange("of this process only")

    setattr(MapMaker, "map", broken)  # noqa: B010
    serve(pipe, folders)


def serve_endless(pipe: Connection, folders: tuple[Path, ...]) -> None:
    """Compute maps for ever; explain as ever."""

    def endless(*_: Any, progress: Any, **__: Any) -> None:
        while True:
            progress(0.5)
            pipe.poll(REPORT_INTERVAL)  # until a cancel is there to be read

    setattr(MapMaker, "map", endless)  # noqa: B010
    serve(pipe, folders)


def serve_compiling(pipe: Connection, folders: tuple[Path, ...]) -> None:
    """Compile something, and get no further with any map."""

    def compiles_first(*_: Any, progress: Any, **__: Any) -> None:
        assert numba.njit(lambda x: x + 1)(1) == 2
        while True:
            progress(0.5)
            pipe.poll(REPORT_INTERVAL)  # until a cancel is there to be read

    setattr(MapMaker, "map", compiles_first)  # noqa: B010
    serve(pipe, folders)
