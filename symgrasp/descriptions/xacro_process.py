"""The process that expands one xacro file: ``python -P -m symgrasp.descriptions.xacro_process``.

xacro evaluates Python expressions of the file, runs them without bounds, and opens whatever files they name.
So it runs in this process, which has limits of time and memory, and where

- expressions are refused that reach for the inside of Python (`_evaluated`);
- nothing is imported, started, written or sent, and, where a folder is given, nothing outside of it is read:
  an audit hook (PEP 578) sees whatever an expression comes to all the same.

It reads a request from its standard input and writes the answer to its standard output, both JSON:
``{"path": …, "args": {name: value}, "inside": folder or null, "seconds": …, "memory": …}`` →
``{"urdf": text, "declared": [names]}``, or ``{"field": …, "value": …, "expected": …}`` for a `UrdfError`.
"""

from __future__ import annotations

import ast
import codecs
import errno
import io
import json
import os
import resource
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast
from xml.dom import minidom

import xacro
from xacro import substitution_args

from symgrasp.descriptions.xml_file import LARGEST_XML
from symgrasp.references import package_folders

__all__: list[str] = []

INTROSPECTION = {
    "mro", "gi_frame", "gi_code", "gi_yieldfrom", "cr_frame", "cr_code", "cr_await", "cr_origin", "ag_frame",
    "ag_code", "ag_await", "f_back", "f_builtins", "f_code", "f_globals", "f_locals", "f_trace", "tb_frame",
    "tb_next", "co_code", "co_consts",
}  # fmt: skip
"""Attributes that lead from values to the inside of Python, besides those with two underscores."""

READING = ("open", "os.listdir", "os.scandir", "glob.glob", "glob.glob/2")
"""Audit events of reading, whose first argument is a path."""

HARMLESS = ("builtins.id", "compile", "exec")
"""Further audit events that an expansion needs: expressions are compiled and executed."""

WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND

ENCODINGS = ("utf-8", "utf-16", "latin-1", "ascii", "cp1252")
"""Of files that can be read."""

FIRST = '<robot name="${1 + 1}" xmlns:xacro="http://www.ros.org/wiki/xacro"><a b="$(eval 1)"/></robot>'
"""What is expanded before anything is forbidden."""

ROOM = 200
"""Characters of xacro's own words that are kept."""


class _Refused(PermissionError):
    """The file wants what no expansion may do.

    Args:
        what: what that is.
        target: of what.
    """

    def __init__(self, what: str, target: object) -> None:
        super().__init__(errno.EACCES, what, str(target))


class _NoPackage(Exception):
    """There is no package of a name."""


class _Arguments(dict[str, str]):
    """The arguments of an expansion, which remembers those that the file asks for."""

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self.declared: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.declared.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.declared.add(name)
        return super().__getitem__(name)


def main() -> None:
    """Answer one request."""
    request = json.load(sys.stdin)
    answer = os.dup(1)
    sys.stdout = sys.stderr = open(os.devnull, "w")  # noqa: SIM115, PTH123 - what files print is not shown
    folder = Path(request["inside"]) if request["inside"] else None
    path = Path(request["path"])
    _limit(request["seconds"], request["memory"])
    _confine(path, folder)
    text = json.dumps(_expand(path, _Arguments(request["args"]))).encode()
    while text:
        text = text[os.write(answer, text) :]
    os._exit(0)  # Python's own way out would be seen by the hook


def _limit(seconds: int, memory: int) -> None:
    for limit, most in (
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_AS, memory),
        (resource.RLIMIT_FSIZE, 0),
        (resource.RLIMIT_CORE, 0),
    ):
        resource.setrlimit(limit, (most, most))


def _confine(path: Path, folder: Path | None) -> None:
    """Let this process do nothing from now on but read files, and those of a folder only if one is given."""
    for name in ENCODINGS:
        codecs.lookup(name)
    xacro.process_doc(minidom.parse(io.StringIO(FIRST)), verbosity=0)  # imports what is imported late
    xacro.safe_eval = _evaluated
    substitution_args._eval = _evaluated_substitution
    find = _finder(path.parent, folder)
    substitution_args._eval_find = find
    substitution_args._eval_dict["find"] = find

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event in HARMLESS:
            return
        if event not in READING:
            raise _Refused(event, arguments[:1])
        target = os.fsdecode(arguments[0])
        if event == "open" and (arguments[2] or 0) & WRITES:
            raise _Refused("writing", target)
        if folder and not Path(os.path.realpath(target)).is_relative_to(folder):
            raise _Refused("reading", target)

    sys.addaudithook(hook)


def _finder(beside: Path, folder: Path | None) -> Callable[[str], str]:
    """Return what seeks the folder of a package for ``$(find package)``, inside a folder if one is given."""

    def find(name: str) -> str:
        for found in package_folders(name, beside):
            if folder is None or found.resolve().is_relative_to(folder):
                return str(found.resolve())
        raise _NoPackage(name)

    return find


def _evaluated(expression: str, symbols: Any, local: Any = None) -> Any:
    """Return the value of an expression of a xacro file, in place of ``xacro.safe_eval``."""
    tree = ast.parse(expression.strip(), "<expression>", "eval")
    for node in ast.walk(tree):
        name = node.attr if isinstance(node, ast.Attribute) else node.id if isinstance(node, ast.Name) else ""
        if name.startswith("__") or (isinstance(node, ast.Attribute) and name in INTROSPECTION):
            raise _Refused("evaluating", expression.strip())
    symbols.update(__builtins__={})
    return eval(compile(tree, "<expression>", "eval"), symbols, local)


def _evaluated_substitution(expression: str, context: dict[str, Any]) -> str:
    """Return the value of ``$(eval …)``, in place of a function that gives it all of Python."""
    arguments = context.setdefault("arg", {})

    def value(name: str) -> Any:
        return substitution_args.convert_value(substitution_args._eval_arg(name, arguments), "auto")

    names = {key: v for key, v in substitution_args._eval_dict.items() if key != "__builtins__"}
    kinds = {kind.__name__: kind for kind in (list, dict, map, str, float, int)}
    own = {name: value(name) for name in arguments}
    return str(_evaluated(expression, {**own, **names, **kinds, "arg": value}))


def _expand(path: Path, arguments: _Arguments) -> dict[str, Any]:
    """Return the answer to a request."""
    try:
        document = xacro.process_file(str(path), mappings=arguments, verbosity=0)
        text = cast(minidom.Document, document).toxml()
    except Exception as error:  # whatever an expression raises
        return _answer_to(error, path)
    if len(text.encode()) > LARGEST_XML:
        expected = f"one that expands to at most {LARGEST_XML / 1e6:g} MB"
        return {"field": "xacro", "value": f"{len(text) / 1e6:.1f} MB", "expected": expected}
    return {"urdf": text, "declared": sorted(arguments.declared)}


def _answer_to(error: BaseException, path: Path) -> dict[str, Any]:
    """Say what was wrong, by the first of the exceptions that led to this one."""
    where = _where(path)
    for cause in _causes(error):
        if isinstance(cause, _Refused):
            expected = "a file that reads nothing but its own parts"
            value = f"{cause.strerror} {cause.filename}"
            return {"field": where, "value": value, "expected": expected}
        if isinstance(cause, _NoPackage):
            expected = f"a package that can be found: beside the file, or with --package {cause}=DIR"
            return {"field": f"{where}: $(find)", "value": str(cause), "expected": expected}
        if isinstance(cause, substitution_args.ArgException):
            expected = f"a value: xacro_args: {{{cause}: …}} in the scene, or --xacro {cause}:=…"
            return {"field": f"{where}: argument", "value": str(cause), "expected": expected}
        if isinstance(cause, FileNotFoundError):
            return {"field": where, "value": str(cause.filename), "expected": "an existing file"}
        if isinstance(cause, MemoryError | RecursionError):
            expected = "one that expands in little memory and without endless recursion"
            return {"field": where, "value": type(cause).__name__, "expected": expected}
    deepest, suffix = error, ""
    while isinstance(deepest, xacro.XacroException) and deepest.exc is not None:
        deepest, suffix = deepest.exc, suffix or deepest.suffix or ""
    text = " ".join(f"{deepest} {suffix}".split()) or type(deepest).__name__
    return {"field": where, "value": text[:ROOM], "expected": "what xacro can expand"}


def _causes(error: BaseException) -> list[BaseException]:
    """Return an exception and those that led to it."""
    found: list[BaseException] = []
    waiting: list[BaseException | None] = [error]
    while waiting:
        at = waiting.pop()
        if isinstance(at, BaseException) and at not in found:
            found.append(at)
            waiting += [getattr(at, "exc", None), at.__cause__, at.__context__]
    return found


def _where(path: Path) -> str:
    """Return the file and the macro that were being read, where that is not the first file."""
    files, macros = xacro.filestack or [], xacro.macrostack or []
    parts = [f"in {Path(str(files[-1])).name}"] if files and files[-1] != str(path) else ["xacro"]
    return ", ".join([*parts, *(f"macro {macro.body.getAttribute('name')}" for macro in macros[-1:])])


if __name__ == "__main__":
    main()
