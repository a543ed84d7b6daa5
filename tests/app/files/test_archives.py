"""Uploaded ZIP files: what is in them comes out, and nothing else, nowhere else, and not too much of it."""

from __future__ import annotations

import io
import stat
import struct
import zipfile
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.files import archives
from app.files.archives import pack, unpack
from symgrasp.errors import InputError


def archive(*entries: tuple[str | zipfile.ZipInfo, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as file:
        for name, content in entries:
            file.writestr(name, content)
    return stream.getvalue()


def special(name: str, mode: int, *, flags: int = 0) -> zipfile.ZipInfo:
    entry = zipfile.ZipInfo(name)
    entry.external_attr = mode << 16
    entry.flag_bits = flags
    return entry


def tree(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture
def folder(tmp_path) -> Path:
    """Two folders deep, so that whatever climbs out of it lands in the temporary folder."""
    inner = tmp_path / "outer" / "inner"
    inner.mkdir(parents=True)
    return inner


def test_files_come_out_as_they_went_in(folder):
    files = {"my_robot/urdf/arm.urdf": b"<robot/>", "my_robot/meshes/ä b.stl": bytes(range(256)) * 40}
    content = pack([*files.items(), ("__MACOSX/my_robot/._arm.urdf", b"x")])
    paths = unpack("robot.zip", content, folder)
    assert tree(folder) == files
    assert [p.relative_to(folder).as_posix() for p in paths] == sorted(files)


@pytest.mark.parametrize(
    "name",
    [
        "/etc/evil", "../evil", "a/../../evil", "a/./evil", "a//evil", "..", "C:/evil", "a\\..\\evil", "a\nb",
        "a\x1b[31m", "\u202evil", "x" * 300, "a/" * 2 + "../" * 3 + "evil", "//evil", "~:evil",
    ],
)  # fmt: skip
def test_names_that_lead_out_are_refused(name, folder, tmp_path):
    with pytest.raises(InputError) as caught:
        unpack("robot.zip", archive(("fine.urdf", b"fine"), (name, b"evil")), folder)
    assert "\n" not in str(caught.value)
    assert tree(tmp_path) == {}


@given(st.text(st.sampled_from("./\\:a"), min_size=1, max_size=12))
def test_nothing_lands_outside(tmp_path_factory, name):
    outer = tmp_path_factory.mktemp("outer")
    folder = outer / "a" / "b"
    folder.mkdir(parents=True)
    try:
        paths = unpack("robot.zip", archive((name, b"x")), folder)
    except InputError:
        paths = []
    found = [path.resolve() for path in outer.rglob("*") if path.is_file()]
    assert found == [path.resolve() for path in paths]
    assert all(path.is_relative_to(folder.resolve()) for path in found)


@pytest.mark.parametrize(
    "kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR, stat.S_IFBLK, stat.S_IFSOCK, stat.S_IFDIR]
)
def test_only_plain_files_come_out(kind, folder, tmp_path):
    content = archive((special("link", kind | 0o777), b"/etc/passwd"), ("link/passwd", b"evil"))
    with pytest.raises(InputError, match="plain files"):
        unpack("robot.zip", content, folder)
    assert list(folder.iterdir()) == []


def test_a_file_may_not_be_a_folder_too(folder):
    with pytest.raises(InputError):
        unpack("robot.zip", archive(("a", b"1"), ("a/b", b"2")), folder)


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize("again", ["arm.urdf", "ARM.urdf"])
def test_every_name_once(again, folder):
    with pytest.raises(InputError, match="every name once"):
        unpack("robot.zip", archive(("arm.urdf", b"1"), (again, b"2")), folder)


def test_too_many_files_are_refused(folder):
    content = archive(*((f"{i}", b"") for i in range(archives.MOST_FILES + 1)))
    with pytest.raises(InputError, match=r"files: .*2,001"):
        unpack("robot.zip", content, folder)
    assert tree(folder) == {}


def test_a_bomb_is_refused_before_it_is_unpacked(folder, monkeypatch):
    monkeypatch.setattr(archives, "UNPACKED_LIMIT", 1_000_000)
    content = archive(*((f"{i}", bytes(300_000)) for i in range(4)))
    assert len(content) < 5_000
    with pytest.raises(InputError, match=r"size unpacked: 1.2 MB"):
        unpack("robot.zip", content, folder)
    assert tree(folder) == {}


def test_a_bomb_that_declares_too_little_is_stopped(folder):
    content = bytearray(archive(("bomb", bytes(50_000_000))))
    small = struct.pack("<L", 1000)
    central = content.rindex(b"PK\x01\x02")
    content[central + 24 : central + 28] = small  # sizes in the directory and before the data
    content[22:26] = small
    with pytest.raises(InputError):
        unpack("robot.zip", bytes(content), folder)
    assert sum(map(len, tree(folder).values())) <= 1000


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_other_compression_is_refused(method, folder):
    with pytest.raises(InputError, match="stored or deflated"):
        unpack("robot.zip", archive(("arm.urdf", b"x"), method=method), folder)


def test_an_encrypted_file_is_refused(folder):
    content = bytearray(archive(("arm.urdf", b"x")))
    content[content.rindex(b"PK\x01\x02") + 8] |= 1
    with pytest.raises(InputError, match="password"):
        unpack("robot.zip", bytes(content), folder)


def test_overlapping_files_are_refused(folder):
    """Many names for the same data: a small archive would become as large as one likes."""
    content = bytearray(archive(("a", b"x" * 1000), ("b", b"y" * 1000)))
    second = content.rindex(b"PK\x01\x02")
    content[second + 42 : second + 46] = struct.pack("<L", 0)
    with pytest.raises(InputError):
        unpack("robot.zip", bytes(content), folder)


def test_what_is_no_zip_file_is_refused(folder):
    whole = archive(("arm.urdf", b"<robot/>" * 100))
    broken = bytearray(whole)
    broken[40] ^= 0xFF
    for content in (b"", b"PK", b"<robot/>", whole[:-5], whole[20:], bytes(broken)):
        with pytest.raises(InputError, match="a complete ZIP file"):
            unpack("robot.zip", content, folder)


def test_a_large_file_is_refused(folder, monkeypatch):
    monkeypatch.setattr(archives, "ARCHIVE_LIMIT", 1000)
    with pytest.raises(InputError, match="size of the file"):
        unpack("robot.zip", bytes(1001), folder)
