"""What references to files mean: paths, and files of packages (``package://<package>/<path>``).

A package is sought in this order, and the first that holds the file is taken:

1. what ``--package NAME=DIR`` names, which is kept in the environment variable `VARIABLE`;
2. a Python package, and a data package that pip installed (``cmeel.prefix/share/<package>``);
3. the folders above the file that holds the reference, as ROS packages are laid out in a workspace;
4. ROS packages below the folders of ``ROS_PACKAGE_PATH``, and ``share/<package>`` of those of
   ``AMENT_PREFIX_PATH``.

Everything that decides is in the file, in the Python environment or in environment variables, so that
processes which are started from this one find the same files.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Iterator
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote

from symgrasp.files import SCENES_DIR

__all__ = [
    "VARIABLE",
    "give_packages",
    "package_dir",
    "package_dirs",
    "package_folders",
    "portable",
    "resolve",
    "sought",
]

VARIABLE = "SYMGRASP_PACKAGES"
"""Environment variable with packages and their folders: ``NAME=DIR``, several joined by colons."""

PACKAGE = re.compile(r"(?:package|model):/+([^/]*)/*(.*)", re.DOTALL)
"""A reference into a package: its name, and the path in it."""

DEEPEST = 6
"""How many folders below one of ``ROS_PACKAGE_PATH`` a package may lie."""

WHERE = "--package NAME=DIR, Python and data packages, folders above, ROS_PACKAGE_PATH, AMENT_PREFIX_PATH"


def give_packages(packages: Iterable[str]) -> None:
    """Name the folders of packages, for this process and those that it starts.

    Args:
        packages: ``NAME=DIR``; a later one of the same name counts.

    Raises:
        ValueError: one of them is not of that form, or there is no such folder.
    """
    given = _packages_given()
    for text in packages:
        name, _, folder = text.partition("=")
        path = Path(folder).expanduser().absolute()
        if not (folder and _is_name(name) and path.is_dir()) or os.pathsep in f"{name}{path}":
            raise ValueError(f"{text!r}: expected NAME=DIR, with an existing folder")
        given[name] = path
    os.environ[VARIABLE] = os.pathsep.join(f"{name}={path}" for name, path in given.items())


def package_dir(name: str) -> Path | None:
    """Return the folder of an importable Python package without importing it, or None.

    ``static_scenes``, which files refer to as a package, is the folder of the shipped scenes wherever
    that is.
    """
    if name == SCENES_DIR.name:
        return SCENES_DIR
    if "." in name:  # finding a subpackage would import its parent
        return None
    try:
        spec = find_spec(name)
    except (ImportError, ValueError):
        return None
    if spec is None or not spec.submodule_search_locations:
        return None
    return Path(next(iter(spec.submodule_search_locations)))


def package_dirs(reference: str) -> list[Path]:
    """Return the folders of the package that a reference names, in order; empty for other references.

    Folders above the file that holds the reference are not among them, nor are Python packages without
    code, for which any folder in the working directory would pass.
    """
    names = [name for name, _ in _parts(reference)]
    return list(dict.fromkeys(d for name in names for d in (*_given(name), *_installed(name), *_ros(name))))


def package_folders(name: str, folder: Path) -> Iterator[Path]:
    """Yield the folders that a package of a name may have, in the order in which they are tried.

    Args:
        name: of the package.
        folder: folder of the file that names it.
    """
    if _is_name(name):
        yield from filter(_is_folder, _candidates(f"package://{name}/", folder))


def resolve(reference: str, folder: Path) -> Path | None:
    """Resolve a reference to a file.

    Args:
        reference: ``package://<package>/<path>``, the same with ``package:///`` or ``model://``,
            ``file://<path>``, or a path relative to ``folder``; as it is, or with ``%20`` for a space and
            the like.
        folder: folder of the file that holds the reference.

    Returns:
        The existing file, or None.
    """
    return next(filter(_is_file, _candidates(reference, folder)), None)


def portable(reference: str, path: Path) -> str | None:
    """Return a reference that means a file from every folder and without options; None if there is none.

    Args:
        reference: a reference.
        path: the file that it was resolved to.
    """
    for name, inner in _parts(reference):
        if any(path == folder / inner for folder in _installed(name)):
            return f"package://{name}/{inner}"
    return None


def sought(reference: str, folder: Path, kind: str) -> str:
    """Return what was expected of a reference that could not be resolved, and where it was sought.

    Args:
        reference: the reference.
        folder: folder of the file that holds it.
        kind: of file, such as mesh.
    """
    parts = _parts(reference)
    if not parts:
        return f"an existing {kind} file; there is no {next(_candidates(reference, folder))}"
    folders = package_dirs(reference)
    if folders:
        return f"an existing {kind} file; there is none in " + ", ".join(map(str, folders))
    return f"an existing {kind} file; no package {parts[0][0]!r} in {WHERE}"


def _parts(reference: str) -> list[tuple[str, str]]:
    """Return name and inner path of a reference into a package: as it is, and with ``%20`` replaced."""
    found = [PACKAGE.fullmatch(text) for text in dict.fromkeys((reference, unquote(reference)))]
    return [(match[1], match[2]) for match in found if match]


def _candidates(reference: str, folder: Path) -> Iterator[Path]:
    """Yield the paths that a reference may stand for, in the order in which they are tried."""
    parts = _parts(reference)
    if not parts:
        for text in dict.fromkeys((reference, unquote(reference))):
            yield folder / text.removeprefix("file://")
    for name, inner in parts:
        python = package_dir(name)
        for root in (*_given(name), python, *_installed(name)):
            if root:
                yield root / inner
    above = (folder.absolute(), *folder.absolute().parents)
    for name, inner in parts:
        for parent in above:
            yield parent / name / inner
        for parent in above:  # a checkout whose folder is called otherwise
            if _ros_name(parent) == name:
                yield parent / inner
    for name, inner in parts:
        for root in _ros(name):
            yield root / inner


def _packages_given() -> dict[str, Path]:
    """Return the packages that the environment variable names."""
    pairs = [text.partition("=") for text in os.environ.get(VARIABLE, "").split(os.pathsep) if text]
    return {name: Path(folder) for name, _, folder in pairs}


def _given(name: str) -> list[Path]:
    """Return the folder of a package that the environment variable names."""
    return [folder for other, folder in _packages_given().items() if other == name]


def _installed(name: str) -> list[Path]:
    """Return the Python package with code and the data packages of a name in this Python environment."""
    if not _is_name(name):
        return []
    python = package_dir(name)
    has_code = python is not None and (python == SCENES_DIR or _is_file(python / "__init__.py"))
    data = [Path(entry) / "cmeel.prefix" / "share" / name for entry in sys.path]
    return [*([python] if python and has_code else []), *filter(_is_folder, data)]


def _ros(name: str) -> list[Path]:
    """Return the ROS packages of a name in the environment: of ROS 1, then of ROS 2."""
    if not _is_name(name):
        return []
    folders = [path for path, other in _ros_packages(os.environ.get("ROS_PACKAGE_PATH", "")) if other == name]
    prefixes = filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))
    shares = [Path(prefix) / "share" / name for prefix in prefixes]
    return [*folders, *filter(_is_folder, shares)]


@lru_cache(maxsize=8)
def _ros_packages(search_path: str) -> list[tuple[Path, str]]:
    """Return the folders with a ``package.xml`` below the folders of a search path, and their names."""
    found = []
    for entry in filter(None, search_path.split(os.pathsep)):
        start = Path(entry)
        for at, folders, files in os.walk(start):
            if "package.xml" in files:  # packages do not lie in packages
                found.append((Path(at), _ros_name(Path(at)) or Path(at).name))
                folders.clear()
            elif len(Path(at).relative_to(start).parts) >= DEEPEST:
                folders.clear()
            folders[:] = sorted(folder for folder in folders if not folder.startswith("."))
    return found


def _ros_name(folder: Path) -> str | None:
    """Return the name that a folder's ``package.xml`` gives; None where there is none."""
    try:
        with (folder / "package.xml").open(encoding="utf-8", errors="replace") as file:
            match = re.search(r"<name>\s*([^<\s]+)\s*</name>", file.read(100_000))
    except (OSError, ValueError):
        return None
    return match[1] if match else None


def _is_name(name: str) -> bool:
    """Whether a package may have this name: it is that of one folder."""
    return name not in ("", ".", "..") and "/" not in name and "\0" not in name


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that is too long, or has a null character
        return False


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False
