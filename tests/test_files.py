from __future__ import annotations

import pytest

from symgrasp.files import resolve


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
