"""A scene whose maps are computed at once."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import write_scene


@pytest.fixture
def small(content, tmp_path) -> Path:
    content["map"] = {"heights": 6, "angles": 8, "redundancy": 4}
    return write_scene(tmp_path, content)
