"""What crosses between processes may be cached by another thread while it is pickled."""

from __future__ import annotations

import pickle
from typing import Any

import pytest

from app.state.requests import MapRequest
from tests.app.state.states import small_map
from tests.conftest import load_small


class Meddler:
    """An attribute whose pickling lets another one be cached, as another thread may at any time."""

    def __init__(self, attributes: dict[str, Any]) -> None:
        self.attributes = attributes

    def __reduce__(self) -> tuple[object, ...]:
        self.attributes["cached meanwhile"] = 1
        return int, ()


def shared() -> dict[str, object]:
    scene = load_small("bottle_on_table", redundancy=5)
    request = MapRequest(scene, "panda", "pick")
    m = small_map("bottle_on_table", "pick", "panda").map.shift(0.1)
    return {
        "scene": scene,
        "arm": scene.arm(),
        "model": scene.arm().robot.model,
        "request": request,
        "map": m,
    }


@pytest.mark.parametrize("name", list(shared()))
def test_an_attribute_that_is_cached_meanwhile_does_not_matter(name):
    value = shared()[name]
    attributes = value.__dict__
    before = dict(attributes)
    attributes["meddler"] = Meddler(attributes)
    try:
        copy = pickle.loads(pickle.dumps(value, protocol=5))
        assert attributes.pop("cached meanwhile") == 1
        assert "cached meanwhile" not in copy.__dict__
    finally:
        for key in set(attributes) - set(before):
            del attributes[key]
