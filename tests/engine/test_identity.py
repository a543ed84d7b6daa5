"""The engine's map is the reference's, cell for cell."""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import yaml
from trimesh.creation import annulus, box, icosphere

from symgrasp.bench.maps.random_scenes import KINDS, scene_of_kind
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.exact.engine import ExactEngine
from symgrasp.poses import translation
from symgrasp.reason import Reason
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld
from tests.conftest import PLAIN, some
from tests.engine.identity import assert_same, assert_true
from tests.engine.random_scenes import ARMS, random_pitched_scene, random_scene, random_torso_scene

SEEDS = 320
AT_ONCE = 20
DATA = Path(__file__).parent.parent / "data"


@pytest.mark.parametrize("name", PLAIN)
def test_shipped_scenes_have_the_same_maps_at_full_grid(name):
    """Every task with every arm that holds the object in it."""
    scene = Scene.load(name).with_settings(redundancy=16)
    with BulletWorld(scene) as world:
        maker = MapMaker(world)
        for task in scene.tasks.values():
            for arm in task.arms:
                exact = maker.map(arm, task)
                assert_same(exact, maker.map(arm, task, method="reference"))
                cells = np.argwhere(exact.reason >= Reason.SELF_COLLISION)[::37]
                assert_true(world, scene, scene.arm(arm), exact, cells)


@pytest.mark.parametrize("first", some(3, range(0, SEEDS, AT_ONCE)))
def test_random_scenes_have_the_same_maps(first, tmp_path_factory):
    for seed in range(first, first + AT_ONCE):
        content = random_scene(seed)
        try:
            check(content)
        except AssertionError as error:
            path = Path(tmp_path_factory.getbasetemp()) / f"{content['name']}.yaml"
            path.write_text(yaml.safe_dump(content))
            raise AssertionError(f"{content['name']}, saved as {path}: {error}") from error


@pytest.mark.parametrize("arm", [arm for arm in ARMS if arm != "five_joints"])
def test_other_arms_have_the_same_maps(arm):
    """One of three parallel joints, one whose first joint is locked, and two of which only two axes meet."""
    feasible = sum(check(random_scene(seed, arm)) for seed in range(AT_ONCE))
    assert feasible > 50


def test_pitched_arms_have_the_same_maps():
    """Arms of five joints, whose hand is on the roll axis, beside it across the fingers, or along them."""
    feasible = [sum(check(random_pitched_scene(seed)) for seed in range(k, 30, 3)) for k in range(3)]
    assert min(feasible) > 10


def test_links_of_every_kind_of_shape_have_the_same_maps(tmp_path):
    """In one link: the parts of an OBJ, a plain mesh, boxes, balls and cylinders."""
    parts = [box([0.1, 0.08, 0.06]), box([0.16, 0.04, 0.05], translation([0.2, 0, 0]))]
    groups, first = [], 1
    for name, part in zip(("near", "far"), parts, strict=True):
        groups += [f"v {x} {y} {z}" for x, y, z in part.vertices] + [f"g {name}"]
        groups += [f"f {a} {b} {c}" for a, b, c in part.faces + first]
        first += len(part.vertices)
    (tmp_path / "parts.obj").write_text("\n".join(groups))
    icosphere(subdivisions=1, radius=0.055).export(tmp_path / "ball.stl")
    shapes = {
        "upper_arm": (("0.05 0 0", '<mesh filename="parts.obj"/>'), ("0.36 0 0", '<sphere radius="0.06"/>')),
        "forearm": (("0.2 0 0", '<box size="0.3 0.07 0.06"/>'), ("0 0 0", '<mesh filename="ball.stl"/>')),
        "wrist_2": (("0 0 -0.05", '<box size="0.06 0.05 0.07"/>'),),
    }
    root = ET.parse(DATA / "three_parallel.urdf")
    for link in root.iter("link"):
        for at, geometry in shapes.get(link.get("name", ""), ()):
            collision = ET.SubElement(link, "collision")
            ET.SubElement(collision, "origin", xyz=at, rpy="0.2 0.3 0.4")
            ET.SubElement(collision, "geometry").append(ET.fromstring(geometry))
    root.write(tmp_path / "arm.urdf")
    feasible = 0
    for seed in range(AT_ONCE // 2):
        content = random_scene(seed, "three_parallel")
        content["robots"][0]["urdf"] = str(tmp_path / "arm.urdf")
        feasible += check(content)
    assert feasible > 20


def test_arms_on_a_torso_have_the_same_maps():
    """Any value of the torso makes a cell feasible, for each arm alone."""
    feasible = sum(check(random_torso_scene(seed)) for seed in range(AT_ONCE // 2))
    assert feasible > 50


def test_robots_that_may_fall_have_the_same_maps():
    """Candidates with which the robot would fall are told the same way."""
    fallen = np.zeros(len(Reason), dtype=int)
    feasible = sum(check(random_torso_scene(seed, falls=True), fallen) for seed in range(AT_ONCE // 2))
    assert feasible > 50
    assert fallen[Reason.OUT_OF_BALANCE] > 20


def test_among_meshes_the_maps_are_the_same(tmp_path, thorough):
    """Fine flat faces, one with a hole, and a surface that is flat nowhere."""
    meshes = {"ball": icosphere(3, 0.1), "ring": annulus(0.05, 0.12, 0.1), "block": box((0.1, 0.15, 0.2))}
    meshes["block"] = meshes["block"].subdivide().subdivide().subdivide()
    for name, mesh in meshes.items():
        mesh.export(tmp_path / f"{name}.stl")
    blocked = feasible = 0
    seeds, least = (12, 50) if thorough else (4, 10)
    for seed in range(seeds):
        content = random_scene(seed)
        for obstacle, name in zip(content["obstacles"], itertools.cycle(meshes), strict=False):
            for shape in ("box", "cylinder", "sphere"):
                obstacle.pop(shape, None)
            obstacle["mesh"] = str(tmp_path / f"{name}.stl")
        counts = np.zeros(len(Reason), dtype=int)
        feasible += check(content, counts)
        blocked += counts[Reason.SCENE_COLLISION]
    assert feasible > least
    assert blocked > least


@pytest.mark.parametrize("kind", KINDS)
def test_scenes_of_other_kinds_have_the_same_maps(kind, tmp_path, thorough):
    """Obstacles of meshes; objects with a cusp, or longer, wider or flatter than any hand is."""
    feasible = sum(check(scene_of_kind(kind, seed, tmp_path)) for seed in range(8 if thorough else 3))
    assert feasible > 0


def check(content, counts=None):
    scene = Scene.from_content(content)
    task, feasible = scene.task(), 0
    with BulletWorld(scene) as world:
        maker = MapMaker(world)
        for arm in task.arms:
            own = scene.arm(arm)
            assert ExactEngine.knows(own.at(0) if own.robot.torso else own)
            exact = maker.map(arm, task)
            assert_same(exact, maker.map(arm, task, method="reference"))
            assert_true(world, scene, scene.arm(arm), exact)
            feasible += np.count_nonzero(exact.feasible)
            if counts is not None:
                counts += np.bincount(exact.reason.ravel(), minlength=len(counts))
        return feasible
