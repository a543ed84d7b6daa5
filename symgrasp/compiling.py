"""Compiling with numba: on first use, with the result cached on disk for later runs."""

from __future__ import annotations

import logging
import multiprocessing
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

import numba
from llvmlite.binding import Linkage
from numba.core import config, event
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import FunctionPass, register_pass
from numba.core.typed_passes import NopythonTypeInference
from numba.extending import register_jitable

from symgrasp.caching import cache_folder, make_folder

__all__ = ["COMPILING_MESSAGE", "ENTRY", "SOURCES", "interpreted", "is_compiled", "njit", "notify_on_compile"]

SOURCES = (
    "collision/**/*.py",
    "compiling.py",
    "engine/**/*.py",
    "feasibility/margins.py",
    "ik/**/*.py",
    "motion/bodies/linkage.py",
    "motion/paths/proof.py",
    "motion/paths/trees.py",
    "object/manifold.py",
    "planners/**/*.py",
    "robot/limits.py",
)
"""Files of this package that hold compiled functions, or constants that are compiled into them."""

COMPILING_MESSAGE = "compiling what this needs, once on this machine; it takes about half a minute"
"""Shown to the user while something is compiled."""

LOCK = "lock"
"""The file in the folder of the cache that a process locks while it writes there."""

ENTRY: dict[str, Any] = {"cache": True, "error_model": "numpy", "nogil": True, "_nrt": False}
"""Options of `njit` for functions that are called from Python and call inner ones. numba translates an inner
function anew for entries with other options. Arrays are allocated by Python, not in compiled code."""

MANGLED, ENVIRONMENT = "_ZN", "_ZN08NumbaEnv"
"""How numba's names of compiled functions begin, and those of their environments."""

log = logging.getLogger(__name__)

_config: Any = config  # numba sets its attributes at import time, where type checkers do not see them


class _Compilations(event.Listener):
    """Listens to numba and calls a function at every compilation that is not a part of another."""

    def __init__(self, notify: Callable[[], None]) -> None:
        self._notify, self._depth = notify, 0

    def on_start(self, event: event.Event) -> None:
        """Call the function, unless something else is being compiled that needs this."""
        self._depth += 1
        if self._depth == 1:
            self._notify()

    def on_end(self, event: event.Event) -> None:
        """Note that it ended."""
        self._depth -= 1


@contextmanager
def notify_on_compile(notify: Callable[[], None]) -> Iterator[None]:
    """Call a function whenever something has to be compiled inside the ``with`` block.

    It is called once for a function and all that is compiled as a part of it. Reading the result of an
    earlier compilation from the disk does not count.
    """
    with event.install_listener("numba:compile", _Compilations(notify)):
        yield


def njit(*, inner: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Compile like `numba.njit`, with a separate disk cache for every state of the files in `SOURCES`.

    numba's own cache checks only the file that a function stands in. Compiled functions contain copies
    of those that they call, so after a change in one file, callers in other files would run old code.
    Where the folder of the cache cannot be written, nothing is cached. With ``NUMBA_DISABLE_JIT`` set,
    functions are interpreted.

    Args:
        inner: the function is there for compiled functions only; from Python it is interpreted. It is
            compiled as a part of those that call it, which takes half the time: numba by itself makes machine
            code of every function, from copies of all that it calls, and writes each to the disk.
        options: of `numba.njit`.
    """

    def compile_later(function: Callable[..., Any]) -> Any:
        if _config.DISABLE_JIT:
            return function
        if inner:
            return register_jitable(pipeline_class=_Compiler, no_cfunc_wrapper=True, **options)(function)
        before = _config.CACHE_DIR
        _config.CACHE_DIR = _cache_dir(before)
        folder = _config.CACHE_DIR
        settings: dict[str, Any] = {**options, "pipeline_class": _Compiler, "no_cfunc_wrapper": True}
        settings["cache"] = options.get("cache", False) and _is_writable(folder)
        try:
            compiled: Any = numba.njit(**settings)(function)
        finally:
            _config.CACHE_DIR = before
        if settings["cache"]:
            compiled._cache.save_overload = _saving(compiled._cache.save_overload, folder)
            if not options.get("_nrt", True):
                compiled._cache.load_overload = compiled._cache._load_overload
        return compiled

    return compile_later


def is_compiled(function: Any) -> bool:
    """Whether a function of `njit` has been compiled on this machine, by this process or an earlier one."""
    if not hasattr(function, "overloads"):  # without numba's compiler
        return True
    cache = getattr(function._cache, "_cache_file", None)
    return bool(function.overloads or (cache and cache._load_index()))


def interpreted(function: Any) -> Callable[..., Any]:
    """Return a function of `njit` as Python runs it, a thousand times slower, with nothing to compile."""
    return getattr(function, "py_func", function)


class _InnerLibrary(JITCodeLibrary):
    """The code of an inner function, which is only linked into that of others."""

    def _optimize_final_module(self) -> None:
        """Leave that to the function that it is linked into."""

    def _finalize_final_module(self) -> None:
        """Make no machine code."""
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: there is no machine code."""
        return 0

    @property
    def codegen(self) -> Any:
        """What tells machine code where its environment is: there is none to tell."""
        return SimpleNamespace(set_env=lambda name, environment: None)


class _EntryLibrary(JITCodeLibrary):
    """The code of a function that is called from Python, with that of all inner functions that it calls."""

    def _optimize_final_module(self) -> None:
        """Optimise all together; nobody else calls these copies, so LLVM may change how they are called.

        Private, not internal: LLVM's linker would still find these by name, for functions that numba compiles
        in its own way with the same inner ones, which would then call them with arguments they do not take.

        Nor does anybody fill in their environments, which only functions called from Python have a use for.
        numba keeps those that it finds, and imports the module of each when it loads the code again.
        """
        inner = [f for f in self._final_module.functions if f.linkage == Linkage.linkonce_odr]
        unused = {ENVIRONMENT + function.name.removeprefix(MANGLED) for function in inner}
        for value in [*inner, *(v for v in self._final_module.global_variables if v.name in unused)]:
            value.linkage = Linkage.private
        super()._optimize_final_module()


@register_pass(mutates_CFG=False, analysis_only=False)
class _ChooseLibrary(FunctionPass):
    """Says what is compiled next goes into, an `_InnerLibrary` or an `_EntryLibrary`."""

    _name = "choose_library"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> Any:
        """Give the lowering, which follows, the library to use; return that no code was changed."""
        library = _InnerLibrary if state.flags.no_cpython_wrapper else _EntryLibrary
        state.library = library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return False


class _Compiler(CompilerBase):
    """numba's compiler, for entries and inner functions."""

    def define_pipelines(self) -> list[Any]:
        """Return numba's own passes, and one more."""
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_ChooseLibrary, NopythonTypeInference)
        passes.finalize()
        return [passes]


@cache
def _is_writable(folder: str) -> bool:
    """Whether files can be written in a folder, which is made; if not, a warning says so."""
    try:
        make_folder(Path(folder))
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        _warn_uncached(folder, error.strerror)
        return False
    return True


def _saving(save: Callable[..., None], folder: str) -> Callable[..., None]:
    """Return numba's function that writes what was compiled, for one process at a time.

    Two that save different versions of a function would give both the same file, and run the wrong one later.
    Writing may fail now: disks may be full.
    """

    def save_if_possible(*overload: Any) -> None:
        try:
            with Path(folder, LOCK).open("w") as lock:
                if fcntl:
                    fcntl.flock(lock, fcntl.LOCK_EX)  # until the file is closed
                save(*overload)
        except OSError as error:
            _warn_uncached(folder, error.strerror)

    return save_if_possible


@cache
def _warn_uncached(folder: str, reason: str) -> None:
    """Warn once, and not in the processes of the page too, that what is compiled is not kept."""
    if multiprocessing.parent_process() is None:
        log.warning(
            "what is compiled cannot be kept in %s (%s): every start compiles it anew", folder, reason
        )


@cache
def _cache_dir(chosen: str) -> str:
    """Return the cache folder for the present state of the files in `SOURCES`.

    Args:
        chosen: the folder that the user chose through ``NUMBA_CACHE_DIR``, if any.
    """
    return str(cache_folder("compiled", SOURCES, chosen=chosen))
