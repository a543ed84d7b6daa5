"""Files of maps with values that no map has: each is refused in one line that names file and field."""

import io
import json
from typing import Any

import numpy as np
import pytest

from symgrasp.errors import MapError
from symgrasp.feasibility.create import create_map
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.reason import Reason
from symgrasp.scene.scene import Scene


@pytest.fixture(scope="module")
def content():
    """What a file of a map has that was asked for all that maps may have."""
    scene = Scene.load("soda_can").with_settings(heights=6, angles=12, redundancy=4)
    scene = scene.with_settings(resolution={"mm": 15, "deg": 10})  # pyright: ignore[reportArgumentType]
    buffer = create_map(scene).to_npz()
    with np.load(io.BytesIO(buffer)) as file:
        data = dict(file)
    feasible = data["reason"] == Reason.FEASIBLE
    assert feasible.any() and (data["pair"] >= 0).any() and "certified" in data
    return data


def load(data, folder):
    path = folder / "map.npz"
    np.savez(path, **data)
    return FeasibilityMap.load(path)


def changed(array: np.ndarray, value: float, where: Any = ...) -> np.ndarray:
    out = array.copy()
    out[where] = value
    return out


def feasible(data):
    return data["reason"] == Reason.FEASIBLE


def test_what_is_not_changed_is_read(content, tmp_path):
    m = load(content, tmp_path)
    assert m.certified is not None and m.refined is not None
    np.testing.assert_array_equal(m.reason, content["reason"])


DAMAGES = {
    "pose of NaN": ("T_world_object", lambda d: changed(d["T_world_object"], np.nan, (0, 3))),
    "infinite pose": ("T_world_object", lambda d: changed(d["T_world_object"], np.inf, (1, 3))),
    "pose that is not rigid": ("T_world_object", lambda d: 2.0 * d["T_world_object"]),
    "pose that mirrors": ("T_world_object", lambda d: d["T_world_object"] @ np.diag([1.0, 1, -1, 1])),
    "pose of another shape": ("T_world_object", lambda d: d["T_world_object"][:3]),
    "pose of text": ("T_world_object", lambda d: d["T_world_object"].astype(str)),
    "text in certified": ("certified", lambda d: d["certified"].astype(str)),
    "numbers in certified": ("certified", lambda d: d["certified"].astype(float)),
    "certified of another shape": ("certified", lambda d: d["certified"][:, :-1]),
    "text in proven": ("proven", lambda d: d["proven"].astype(str)),
    "proven cells that are feasible": ("proven", lambda d: np.ones_like(d["proven"])),
    "text in reason": ("reason", lambda d: d["reason"].astype(str)),
    "negative reasons": ("reason", lambda d: -d["reason"].astype(np.int16)),
    "reasons without a name": ("meta", lambda d: changed(d["reason"], 200)),
    "text in q": ("q", lambda d: d["q"].astype(str)),
    "q of another shape": ("q", lambda d: d["q"][:, :, :-1]),
    "q without joints": ("q", lambda d: d["q"][..., :0]),
    "q of one number": ("q", lambda d: np.array(1.0)),
    "q of NaN": ("q", lambda d: np.full_like(d["q"], np.nan)),
    "samples that are no integers": ("sample", lambda d: d["sample"].astype(float)),
    "samples beyond those there are": ("sample", lambda d: changed(d["sample"], 1000, feasible(d))),
    "samples below zero": ("sample", lambda d: changed(d["sample"], -1, feasible(d))),
    "branches below zero": ("branch", lambda d: changed(d["branch"], -1, feasible(d))),
    "clearances of NaN": ("clearance", lambda d: changed(d["clearance"], np.nan)),
    "clearances below zero": ("clearance", lambda d: changed(d["clearance"], -1e-3)),
    "no phi": ("phi", lambda d: d["phi"][:0]),
    "phi of NaN": ("phi", lambda d: changed(d["phi"], np.nan, 0)),
    "phi in rows": ("phi", lambda d: d["phi"][None]),
    "openings of NaN": ("opening", lambda d: changed(d["opening"], np.nan, 0)),
    "openings of another grid": ("opening", lambda d: d["opening"][:-1]),
    "pairs without a name": ("pair", lambda d: changed(d["pair"], 1000)),
    "pairs below -1": ("pair", lambda d: changed(d["pair"], -2)),
    "half a pair": ("pair", lambda d: changed(d["pair"], -1, (..., 1))),
    "depths of NaN": ("depth", lambda d: changed(d["depth"], np.nan)),
    "text in the parts": ("refined_certified", lambda d: d["refined_certified"].astype(str)),
    "profile of NaN": ("meta", lambda d: changed(d["profile"], np.nan)),
}  # fmt: skip


@pytest.mark.parametrize("name", DAMAGES)
def test_arrays_that_no_map_has(name, content, tmp_path):
    field, damage = DAMAGES[name]
    array = {"reasons without a name": "reason", "profile of NaN": "profile"}.get(name, field)
    _refused({**content, array: damage(content)}, field, tmp_path)


@pytest.mark.parametrize("name", ["T_world_object", "q", "phi", "refined_reason", "refined_certified"])
def test_arrays_that_are_missing(name, content, tmp_path):
    data = {key: value for key, value in content.items() if key != name}
    with pytest.raises(MapError, match=name):
        load(data, tmp_path)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("version", True),
        ("version", 3.0),
        ("version", None),
        ("heights", 6.0),
        ("heights", 0),
        ("angles", True),
        ("angles", "12"),
        ("theta_start", "0"),
        ("theta_start", float("nan")),
        ("theta_start", 10**400),
        ("scene", 5),
        ("arm", None),
        ("task", ["pick"]),
        ("bodies", "can"),
        ("bodies", [1, 2]),
        ("resolution", -1.0),
        ("resolution", "fine"),
        ("preliminary", 1),
    ],
)
def test_values_that_no_map_has(field, value, content, tmp_path):
    meta = {**json.loads(str(content["meta"])), field: value}
    _refused({**content, "meta": np.array(json.dumps(meta))}, field, tmp_path)


@pytest.mark.parametrize("meta", ["[]", "3", '"map"', "null"])
def test_what_is_no_description_of_a_map(meta, content, tmp_path):
    _refused({**content, "meta": np.array(meta)}, "meta", tmp_path)


def _refused(data, field, folder):
    with pytest.raises(MapError) as caught:
        load(data, folder)
    assert caught.value.field == field
    assert "\n" not in str(caught.value) and "map.npz" in str(caught.value)
