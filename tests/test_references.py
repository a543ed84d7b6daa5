"""What references to files mean, in which order packages are sought, and what a missing file is told."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from symgrasp.references import VARIABLE, give_packages, package_dirs, portable, resolve, sought


@pytest.mark.parametrize(
    "reference",
    [
        "my robot/arm.urdf", "my%20robot/arm.urdf", "file://my%20robot/arm.urdf",
        "file://{here}/my robot/arm.urdf",
        "file://{here}/my%20robot/arm.urdf", "{here}/my%20robot/arm.urdf", "package://my%20robot/arm.urdf",
    ],
)  # fmt: skip
def test_references_with_spaces(tmp_path, reference):
    (tmp_path / "my robot").mkdir()
    path = tmp_path / "my robot/arm.urdf"
    path.touch()
    found = resolve(reference.format(here=tmp_path), tmp_path)
    assert found == path


def test_a_name_that_holds_a_percent_sign_comes_first(tmp_path):
    for name in ("a%20b.stl", "a b.stl"):
        (tmp_path / name).touch()
    assert resolve("a%20b.stl", tmp_path) == tmp_path / "a%20b.stl"
    assert resolve("a b.stl", tmp_path) == tmp_path / "a b.stl"


@pytest.mark.parametrize(
    "reference", ["", "missing.stl", "file:///missing.stl", "%00", "x" * 5000, "package://"]
)
def test_what_is_not_there(tmp_path, reference):
    assert resolve(reference, tmp_path) is None


@pytest.fixture
def packages(tmp_path, monkeypatch):
    """The same package in every place where one may lie, in the order in which they are searched."""
    monkeypatch.setenv(VARIABLE, "")
    code, environment = tmp_path / "code", tmp_path / "environment"
    work, ros, ament = tmp_path / "work", tmp_path / "ros", tmp_path / "ament"
    places = [
        tmp_path / "given", code / "arms", environment / "cmeel.prefix/share/arms", work / "arms",
        work / "checkout", ros / "group/folder", ament / "share/arms",
    ]  # fmt: skip
    for place in places:
        (place / "my meshes").mkdir(parents=True)
        (place / "my meshes/a.stl").touch()
    (code / "arms/__init__.py").touch()
    for place in (work / "checkout", ros / "group/folder"):
        (place / "package.xml").write_text("<package><name>arms</name></package>")
    monkeypatch.syspath_prepend(str(code))
    monkeypatch.syspath_prepend(str(environment))
    monkeypatch.setenv("ROS_PACKAGE_PATH", f"{tmp_path / 'nowhere'}:{ros}")
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{ament}")
    give_packages([f"arms={places[0]}"])
    return places


@pytest.mark.parametrize(
    "reference",
    [
        "package://arms/my meshes/a.stl", "package:///arms/my%20meshes/a.stl", "model://arms/my%20meshes/a.stl",
        "package://arms//my meshes/a.stl",
    ],
)  # fmt: skip
def test_packages_are_sought_in_the_documented_order(packages, reference):
    folder = packages[4] / "urdf"
    folder.mkdir()
    for place in packages:
        found = resolve(reference, folder)
        assert found is not None
        assert found.samefile(place / "my meshes/a.stl")
        found.unlink()
    assert resolve(reference, folder) is None


def test_only_files_of_the_environment_mean_the_same_everywhere(packages):
    reference = "model:///arms/my%20meshes/a.stl"
    for k, place in enumerate(packages):
        path = place / "my meshes/a.stl"
        assert portable(reference, path) == ("package://arms/my meshes/a.stl" if k in (1, 2) else None)
    assert portable("my meshes/a.stl", packages[1] / "my meshes/a.stl") is None


def test_folders_above_a_file_are_no_packages_that_uploads_may_name(packages, tmp_path, monkeypatch):
    assert package_dirs("package://arms/x") == [*packages[:3], *packages[5:]]
    (tmp_path / "secret").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend("")
    for reference in ("package://secret/x", "package://../x", "package://%2e%2e/x", "package://./x", "a/b"):
        assert package_dirs(reference) == []


def test_processes_that_are_started_find_the_same(packages):
    code = (
        "import pathlib, symgrasp.references as r\n"
        "print(r.resolve('package://arms/my meshes/a.stl', pathlib.Path()))"
    )
    path = os.pathsep.join(sys.path)
    run = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": path}, capture_output=True, check=True
    )
    assert run.stdout.decode().strip() == str(packages[0] / "my meshes/a.stl")


@pytest.mark.parametrize("text", ["arms", "arms=", "=.", "arms=missing", "a/b=.", "arms=a:b"])
def test_a_package_without_a_folder_is_refused(text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a:b").mkdir()
    monkeypatch.setenv(VARIABLE, "")
    with pytest.raises(ValueError, match="expected NAME=DIR, with an existing folder"):
        give_packages([text])


def test_what_is_missing_says_where_it_was_sought(packages, tmp_path):
    assert sought("package://legs/a.stl", tmp_path, "mesh").startswith(
        "an existing mesh file; no package 'legs' in --package NAME=DIR, Python and data packages, folders"
    )
    assert sought("package://arms/b.stl", tmp_path, "mesh").startswith(
        f"an existing mesh file; there is none in {packages[0]}, {packages[1]}"
    )
    assert sought("b.stl", tmp_path, "mesh") == f"an existing mesh file; there is no {tmp_path / 'b.stl'}"
