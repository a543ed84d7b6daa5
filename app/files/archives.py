"""ZIP files of robots and scenes: unpacking uploaded ones safely, and packing.

An uploaded archive is not trusted. It is unpacked in the process that computes for the session, into a folder
of its own: only plain files, under plain relative names, no more of them and no larger than the limits,
whatever the archive says of their sizes.
"""

from __future__ import annotations

import io
import stat
import zipfile
from collections.abc import Iterable
from pathlib import Path, PurePosixPath
from typing import NoReturn

from symgrasp.errors import InputError, printable

__all__ = ["ARCHIVE_LIMIT", "is_archive", "names_in", "pack", "unpack"]

ARCHIVE_LIMIT = 50_000_000
"""Largest archive (bytes) that is read."""

UNPACKED_LIMIT = 200_000_000
"""Most bytes of all files of an archive together."""

MOST_FILES = 2_000
"""Most files and folders of an archive."""

LONGEST_NAME = 240
"""Most characters of a name in an archive, with its folders."""

CHUNK = 1 << 20
"""How many bytes are unpacked at once."""

METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
"""How files may be compressed: the other methods may take any amount of memory."""

ENCRYPTED = 0x1
"""The flag of an encrypted file."""

IGNORED = "__MACOSX"
"""Folder that macOS adds to archives, with hidden copies of all names."""


def is_archive(content: bytes) -> bool:
    """Return whether the content of a file is that of a ZIP file."""
    return content.startswith(b"PK")


def names_in(content: bytes) -> list[PurePosixPath]:
    """Return the names of the files that an archive says it holds, at most so many; none if it is damaged."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return [PurePosixPath(name) for name in archive.namelist()[:MOST_FILES]]
    except MemoryError:
        raise
    except Exception:  # of a damaged archive, whatever the reader raises
        return []


def unpack(name: str, content: bytes, folder: Path) -> list[Path]:
    """Unpack an archive into an empty folder.

    Args:
        name: of the archive, for error messages.
        content: of the archive.
        folder: where to; what is there after an error is of no use.

    Returns:
        The files, in the order of their names.

    Raises:
        InputError: it is no ZIP file, is damaged or too large, or holds what is no plain file with a plain
            relative name.
    """
    if len(content) > ARCHIVE_LIMIT:
        _refuse(name, "size of the file", _mb(len(content)), f"a ZIP file of at most {_mb(ARCHIVE_LIMIT)}")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            entries = [entry for entry in archive.infolist() if _parts(entry)[:1] != (IGNORED,)]
            _check(name, entries)
            left = UNPACKED_LIMIT
            files = []
            for entry in entries:
                path = folder.joinpath(*_parts(entry))
                if entry.is_dir():
                    path.mkdir(parents=True, exist_ok=True)
                    continue
                path.parent.mkdir(parents=True, exist_ok=True)
                left -= _extract(name, archive, entry, path, left)
                files.append(path)
    except InputError:
        raise
    except MemoryError:
        raise
    except Exception as error:  # of a damaged archive, whatever the readers raise; or a name that is taken
        _refuse(name, "file", _reason(error), "a complete ZIP file")
    return sorted(files)


def pack(files: Iterable[tuple[str, bytes]]) -> bytes:
    """Return a ZIP file with files: name in it → content."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for inner, content in files:
            archive.writestr(zipfile.ZipInfo(inner, (1980, 1, 1, 0, 0, 0)), content, zipfile.ZIP_DEFLATED)
    return stream.getvalue()


def _check(name: str, entries: list[zipfile.ZipInfo]) -> None:
    """Raise InputError unless all entries may be unpacked, by what the archive says of them."""
    if len(entries) > MOST_FILES:
        _refuse(name, "files", f"{len(entries):,} of them", f"at most {MOST_FILES:,}")
    size = sum(entry.file_size for entry in entries)
    if size > UNPACKED_LIMIT:
        _refuse(name, "size unpacked", _mb(size), f"at most {_mb(UNPACKED_LIMIT)}")
    seen: set[str] = set()
    for entry in entries:
        inner, parts = entry.filename, _parts(entry)
        plain = inner == printable(inner) and not set('\\:*?"<>|') & set(inner)
        if not (plain and parts and "" not in parts and not {".", ".."} & set(parts)):
            _refuse(name, "name", inner, "a relative path without '..' and special characters")
        if len(inner) > LONGEST_NAME:
            _refuse(name, "name", inner, f"at most {LONGEST_NAME} characters")
        if inner.rstrip("/").casefold() in seen:
            _refuse(name, "name", inner, "every name once")
        seen.add(inner.rstrip("/").casefold())
        kind = stat.S_IFMT(entry.external_attr >> 16)
        if kind not in (0, stat.S_IFREG, stat.S_IFDIR) or (kind == stat.S_IFDIR) > entry.is_dir():
            _refuse(name, inner, "a link or a device", "plain files and folders")
        if entry.flag_bits & ENCRYPTED:
            _refuse(name, inner, "encrypted", "files that can be read without a password")
        if entry.compress_type not in METHODS:
            _refuse(name, inner, f"compression method {entry.compress_type}", "files stored or deflated")


def _parts(entry: zipfile.ZipInfo) -> tuple[str, ...]:
    """Return the parts of an entry's name; of an absolute one, the first is empty."""
    return tuple(entry.filename.removesuffix("/").split("/"))


def _extract(name: str, archive: zipfile.ZipFile, entry: zipfile.ZipInfo, path: Path, largest: int) -> int:
    """Write a file, and return its size (bytes), which may not be larger than declared nor than a limit."""
    size, allowed = 0, min(largest, entry.file_size)
    with archive.open(entry) as source, path.open("xb") as target:
        while chunk := source.read(CHUNK):
            size += len(chunk)
            if size > allowed:
                _refuse(name, entry.filename, "larger than declared", "a complete ZIP file")
            target.write(chunk)
    return size


def _refuse(name: str, field: str, value: object, expected: str) -> NoReturn:
    raise InputError(PurePosixPath(name).name, field, value, expected)


def _reason(error: Exception) -> str:
    """Return why an archive cannot be unpacked, without the path of the folder."""
    if isinstance(error, OSError):
        return error.strerror or type(error).__name__
    return str(error) or type(error).__name__


def _mb(size: int) -> str:
    return f"{size / 1e6:g} MB" if size in (ARCHIVE_LIMIT, UNPACKED_LIMIT) else f"{size / 1e6:.1f} MB"
