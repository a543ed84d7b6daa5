"""What an uploaded file is taken for."""

from __future__ import annotations

import pytest

from app.files.file_kinds import file_kind
from symgrasp.scene.shipped import shipped_scenes
from tests.motion.recorded import recorded_plan


def test_a_plan_is_a_plan():
    assert file_kind(recorded_plan().model_dump_json().encode()) == "plan"


@pytest.mark.parametrize("name", shipped_scenes())
def test_a_scene_is_a_scene(name):
    assert file_kind(shipped_scenes()[name].read_bytes()) == "scene"


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[1, 2]",
        b"a: b",
        b"\xff\xfe",
        b"{" * 10_000,
        b'{"tasks": [], "kind": "sequential"}',
        b"!!x",
    ],
)
def test_anything_else_is_neither(content):
    assert file_kind(content) is None


def test_an_archive_may_hold_a_scene():
    assert file_kind(b"PK\x03\x04...") == "scene"
