"""Files that are made to break their reader are refused before they are read."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from symgrasp.files import DEEPEST, LARGEST_YAML, LONGEST, MOST_VALUES, parse_yaml, read_file
from tests.hostile import doubling_yaml


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (doubling_yaml(12), f"more than {MOST_VALUES:,} values"),
        (doubling_yaml(12, merged=True), f"more than {MOST_VALUES:,} values"),
        ("[" + "1," * MOST_VALUES + "]", f"more than {MOST_VALUES:,} values"),
        ("[" * (DEEPEST + 1), f"nested more than {DEEPEST} deep"),
        ("[" * (LARGEST_YAML - 1), "deep|depth"),
        ("- " * 100_000, f"nested more than {DEEPEST} deep"),
        ("1:" * LONGEST, f"a value of more than {LONGEST:,} characters"),
        (" " * (LARGEST_YAML + 1), "more than 1 MB"),
        ("a: &a [*a]", r"the alias \*a before the end"),
        ("a: &a {<<: *a}", r"the alias \*a before the end"),
        ("a: *b", r"the alias \*b before the end"),
        ("{b: 1, a: 1, b: 2}", "the key 'b' twice"),
        ("{" + "".join(f"a{i}: 1," for i in range(40_000)) + " a7: 2}", "the key 'a7' twice"),
        ("9" * 9000, "4300 digits"),
    ],
    ids=lambda value: value[:20],
)
def test_a_hostile_document_is_refused_before_it_is_built(text, message, monkeypatch):
    build, built = yaml.constructor.BaseConstructor.construct_document, []

    def noted(loader, node):
        built.append(node)
        return build(loader, node)

    monkeypatch.setattr(yaml.constructor.BaseConstructor, "construct_document", noted)
    with pytest.raises(ValueError, match=message) as caught:
        parse_yaml(text)
    assert "\n" not in str(caught.value)
    assert bool(built) == ("twice" in message or "digits" in message)


@pytest.mark.parametrize(
    "text",
    ["[" * DEEPEST + "1" + "]" * DEEPEST, "x" * LONGEST, doubling_yaml(4)],
    ids=lambda text: text[:20],
)
def test_what_is_within_the_limits_is_read_as_by_any_other_reader(text):
    assert parse_yaml(text) == yaml.safe_load(text)


def test_aliases_and_merged_keys_mean_what_they_mean_elsewhere():
    text = "a: &a {x: 1, y: [1, 2]}\nb: *a\nc: {<<: *a, z: 3}\n"
    assert parse_yaml(text) == yaml.safe_load(text)


def test_no_more_of_a_file_is_read_than_it_may_hold(tmp_path):
    path = tmp_path / "file"
    path.write_bytes(bytes(100))
    assert read_file(path, 100) == bytes(100)
    with pytest.raises(ValueError, match=r"more than 9\.9e-05 MB"):
        read_file(path, 99)
    endless = Path("/dev/zero")
    if endless.exists():
        with pytest.raises(ValueError, match="more than 1 MB"):
            read_file(endless, LARGEST_YAML)
