"""Processes that compute as they should not; see `app.compute.process_main.serve`."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import nullcontext, suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numba
import numpy as np
from numba.extending import overload

from app.compute import map_service
from app.compute.limits import MEMORY_LIMIT
from app.compute.process_main import REPORT_INTERVAL, serve
from app.compute.upload_service import UploadService
from symgrasp.errors import Cancelled, MeshError
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


def _slow() -> int:
    """Return 1; compiled code may call it."""
    return 1


def serve_slow_compiler(pipe: Connection, folders: tuple[Path, ...]) -> None:
    """For any map, compile until the pipe ``go on`` is written to, and make the folder ``compiled``."""

    @overload(_slow)
    def compiled_slow() -> Callable[[], int]:
        (folders[0] / "go on").read_text()
        (folders[0] / "compiled").mkdir()
        return lambda: 1

    def compiles_first(*_: Any, progress: Any, **__: Any) -> None:
        assert numba.njit(lambda: _slow())() == 1
        progress(0.5)

    setattr(MapMaker, "map", compiles_first)  # noqa: B010
    serve(pipe, folders)


def serve_uncompiled(pipe: Connection, folders: tuple[Path, ...]) -> None:
    """Compute maps as where the code of the exact ones has to be compiled first."""
    setattr(map_service, "is_map_compiled", lambda *_: False)  # noqa: B010
    serve(pipe, folders)


def serve_coarse(pipe: Connection, folders: tuple[Path, ...]) -> None:
    """Get no further than compiling, as where the code of exact maps has to be compiled first."""
    setattr(map_service, "is_map_compiled", lambda *_: False)  # noqa: B010
    serve_compiling(pipe, folders)


def serve_parsers(pipe: Connection, folders: tuple[Path, ...]) -> None:
    """Do to the parser of meshes what the name of a file says; read anything else as ever."""
    measure = UploadService.measure

    def misbehave(
        service: UploadService,
        name: str,
        content: bytes,
        scale: float,
        tolerance: float | None,
        progress: Any,
    ) -> Any:
        pipe.poll(2 * REPORT_INTERVAL)  # so that no report is left out
        with suppress(Cancelled) if name == "hangs.stl" else nullcontext():
            progress(0.5)
        if name == "hangs.stl":
            while True:  # and hears nothing, not even a cancel that came with the report
                pass
        if name == "eats":
            try:
                np.zeros(2 * MEMORY_LIMIT, dtype=np.uint8)  # some of what it had may be free by now
            except Exception as error:  # as where any error of a library is one of the file
                raise MeshError(name, "content", str(error), "a mesh") from error
        if name == "aborts":
            os.abort()
        return measure(service, name, content, scale, tolerance, progress)

    setattr(UploadService, "measure", misbehave)  # noqa: B010
    serve(pipe, folders)
