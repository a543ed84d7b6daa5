"""The line of an input error."""

import pytest

from symgrasp.errors import LONGEST, InputError


@pytest.mark.parametrize("folder", ["", "/folder" * 10, "/folder" * 100])
def test_what_was_expected_is_whole_however_long_the_rest(folder):
    expected = "two axes at one end of the arm that meet in a point"
    error = InputError(f"{folder}/arm.urdf", "arm left", [f"joint_{i}" for i in range(1000)], expected)
    assert str(error).endswith(f": expected {expected}")
    assert "arm left" in str(error)
    assert len(str(error)) <= LONGEST


def test_a_long_text_of_what_was_expected_leaves_the_rest():
    error = InputError("scene.yaml", "robots[0].arms", "panda" * 100, "one of " + "'arm', " * 100)
    assert str(error).startswith("scene.yaml: robots[0].arms: 'panda")
    assert "one of 'arm'" in str(error)
    assert len(str(error)) <= LONGEST
