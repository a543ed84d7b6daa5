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
    assert error.without_source.startswith("arm left: ['joint_0'")
    assert error.without_source.endswith(f": expected {expected}")
    assert error.without_source == InputError("", "arm left", error.value, expected).without_source


def test_a_long_text_of_what_was_expected_leaves_the_rest():
    error = InputError("scene.yaml", "robots[0].arms", "panda" * 100, "one of " + "'arm', " * 100)
    assert str(error).startswith("scene.yaml: robots[0].arms: 'panda")
    assert "one of 'arm'" in str(error)
    assert len(str(error)) <= LONGEST


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (None, "nothing"), ([], "an empty list"), ((), "an empty list"), ({}, "an empty mapping"),
        (True, "true"), ("195.9 m", "195.9 m"), ("5,001 of them", "5,001 of them"),
        ("panda", "'panda'"), ("", "''"), ("1 2", "'1 2'"), ("0.1", "'0.1'"), (0.1, "0.1"),
    ],
)  # fmt: skip
def test_values_are_said_as_people_say_them(value, said):
    assert (
        str(InputError("scene.yaml", "robots", value, "more")) == f"scene.yaml: robots: {said}: expected more"
    )


def test_an_integer_of_thousands_of_digits_is_told():
    assert "a very large number" in str(InputError("scene.yaml", "robots", 10**10_000, "a smaller one"))
