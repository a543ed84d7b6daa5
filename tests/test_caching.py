"""What is kept on the disk comes back as it was, and is computed again where it cannot."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from symgrasp import caching
from symgrasp.errors import MeshError
from symgrasp.files import file_sha256
from symgrasp.robot import link_shapes

ARRAYS = (np.arange(6.0).reshape(2, 3), np.zeros((0, 2), dtype=int))


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.setattr(caching, "_folder", lambda: tmp_path / "kept")
    return tmp_path / "kept"


class Counted:
    def __init__(self, arrays=ARRAYS) -> None:
        self.arrays, self.calls = arrays, 0

    def __call__(self):
        self.calls += 1
        return self.arrays


def test_arrays_come_back_as_they_were(folder):
    compute = Counted()
    for _ in range(3):
        found = caching.kept(("a", "1"), compute)
        assert all(np.array_equal(a, b) and a.dtype == b.dtype for a, b in zip(found, ARRAYS, strict=True))
    assert compute.calls == 1
    assert np.array_equal(caching.kept(("a", "2"), Counted((np.ones(1),)))[0], [1.0])


@pytest.mark.parametrize("cut", [0, 10, 200])
def test_a_damaged_file_is_computed_anew(folder, cut):
    caching.kept(("a",), Counted())
    (file,) = folder.iterdir()
    file.write_bytes(file.read_bytes()[:cut])
    compute = Counted()
    assert np.array_equal(caching.kept(("a",), compute)[0], ARRAYS[0])
    assert compute.calls == 1


def test_a_changed_byte_is_noticed(folder):
    caching.kept(("a",), Counted())
    (file,) = folder.iterdir()
    content = file.read_bytes()
    at = content.index(ARRAYS[0].tobytes()) + 12
    file.write_bytes(content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :])
    assert np.array_equal(caching.kept(("a",), Counted())[0], ARRAYS[0])


def test_nothing_is_kept_where_nothing_can_be_written(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setattr(caching, "_folder", lambda: tmp_path / "file" / "kept")
    compute = Counted()
    for _ in range(2):
        assert np.array_equal(caching.kept(("a",), compute)[0], ARRAYS[0])
    assert compute.calls == 2


def test_the_oldest_go_when_there_is_too_much(folder, monkeypatch):
    for k in range(6):
        caching.kept((k,), Counted((np.zeros(1000),)))
        for age, path in enumerate(sorted(folder.iterdir(), key=lambda path: path.stat().st_mtime)):
            os.utime(path, (age, age))
    size = next(folder.iterdir()).stat().st_size
    monkeypatch.setattr(caching, "MOST_BYTES", 6 * size)
    caching.kept((6,), Counted((np.zeros(1000),)))
    assert len(list(folder.iterdir())) == 3
    newest = Counted()
    caching.kept((6,), newest)
    assert newest.calls == 0


def test_the_folder_depends_on_sources_and_versions(tmp_path):
    def at(*versions):
        return caching.cache_folder("kept", ("poses.py",), versions, str(tmp_path))

    assert at("1") == at("1") != at("2")
    assert caching.cache_folder("kept", ("files.py",), ("1",), str(tmp_path)) != at("1")


def test_only_the_latest_states_are_left(tmp_path):
    def make(digit, kind="kept"):
        folder = tmp_path / f"{kind}-{digit * 16}"
        caching.make_folder(folder)
        os.utime(folder, (int(digit), int(digit)))
        return folder

    (tmp_path / "kept-by the user").mkdir()
    other = make("1", "compiled")
    folders = [make(digit) for digit in "123456"]
    (folders[-1] / "file").touch()
    caching.make_folder(folders[-1])  # is there already
    left = [path for path in folders if path.is_dir()]
    assert left == folders[-caching.STATES :]
    assert (folders[-1] / "file").exists()
    assert other.is_dir()
    assert (tmp_path / "kept-by the user").is_dir()


def test_a_mesh_that_changed_since_it_was_hashed_is_refused(folder, tmp_path):
    path = tmp_path / "box.off"
    path.write_text("OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n")
    before = file_sha256(path)
    path.write_text(path.read_text().replace("0 0 1\n", "0 0 2\n", 1))
    with pytest.raises(MeshError, match="changed"):
        link_shapes._mesh_hulls(path, before, (1.0, 1.0, 1.0), "link")
    assert not folder.exists()
