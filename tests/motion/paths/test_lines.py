"""Straight paths of the tool, against an exhaustive search, forward kinematics and maps with an approach."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from symgrasp.feasibility.create import create_map
from symgrasp.ik import Solver, solver_for
from symgrasp.motion.bodies.motion_scene import MotionScene
from symgrasp.motion.bodies.situation import Situation
from symgrasp.motion.drafting.ways import straight
from symgrasp.motion.paths.lines import CLEAR, LARGEST_TURN, Leg, configurations, follow
from symgrasp.motion.paths.search import NoMotionError, prove
from symgrasp.object.manifold import ROLLS
from symgrasp.poses import Array, pose_error, rotation_about, translation
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
from tests.conftest import load_small

OFF = 1e-3
"""How far (m) points 0.1 m from the tool may be off the path in the middle of two samples."""


def approach(
    scene: Scene, h: float, theta: float, roll: float, length: float
) -> tuple[Situation, list[Array]]:
    """Return the first arm of a scene beside its object, and tool poses (4, 4) straight in to a grasp."""
    arm, radius = scene.arm(scene.task().arms[0]), float(scene.profile.radius(h))
    tool = scene.task().T_world_object @ arm.hand.tool_pose(np.eye(4), h, theta, roll, radius)
    with open_world(scene) as world:
        bodies = MotionScene(scene, world)
        state = bodies.home()
        state = state.with_arm(arm, state.joints(arm), arm.hand.opening(radius))
        situation = bodies.situation(state, [arm], touching=[arm])
    return situation, straight(tool @ translation([0, 0, -length]), tool)


def middle(a: Array, b: Array) -> Array:
    """Return the pose (4, 4) half way, of two that differ by a shift or by a small turn."""
    mean = 0.5 * (a + b)
    u, _, v = np.linalg.svd(mean[:3, :3])
    mean[:3, :3] = u @ v
    return mean


def exhaustive(
    situation: Situation, solver: Solver, poses: Sequence[Array]
) -> dict[tuple[float, ...], float]:
    """Return configuration at the end → largest smallest clearance (m) of all ways there."""
    arm = solver.arm
    layer = configurations(solver, poses[0])
    proof = prove(situation, layer, layer, CLEAR)
    layer, value = layer[proof.free], proof.clearance[proof.free]
    for before, pose in pairwise(poses):
        found = configurations(solver, pose)
        near = found + 2 * np.pi * np.round((layer[:, None] - found) / (2 * np.pi))
        near = np.where((near < arm.lower) | (near > arm.upper), found, near)
        a, b = np.nonzero(np.abs(near - layer[:, None]).max(axis=2) <= LARGEST_TURN)
        start, end = layer[a], near[a, b]
        position, angle = pose_error(arm.world_tool_pose(0.5 * (start + end)), middle(before, pose))
        proof = prove(situation, start, end, CLEAR)
        best: dict[tuple[float, ...], tuple[Array, float]] = {}
        for k in np.flatnonzero(proof.free & (position + 0.1 * angle <= OFF)):
            key, own = tuple(end[k].round(7)), min(float(proof.clearance[k]), float(value[a[k]]))
            if key not in best or own > best[key][1]:
                best[key] = end[k], own
        layer = np.array([q for q, _ in best.values()]).reshape(-1, arm.dof)
        value = np.array([own for _, own in best.values()])
    return {tuple(q.round(7)): own for q, own in zip(layer, value, strict=True)}


@pytest.mark.parametrize(
    ("name", "samples", "cells"),
    [
        ("pick_pour_place", 24, 8),
        ("ur5_bottle", 1, 8),
        # Where samples are so many that a joint may turn by several of them at once.
        ("bottle_on_table", 160, [(0, 10, 15)]),
    ],
)
def test_no_way_along_a_path_keeps_further_from_things_than_the_one_that_is_found(name, samples, cells):
    """To every configuration at the end that any way leads to, and to no other one."""
    scene = load_small(name, 12, 16, 8)
    m = create_map(scene)
    if isinstance(cells, int):
        cells = np.random.default_rng(1).permutation(np.argwhere(m.feasible))[:cells]
    solver, compared = solver_for(scene.arm(scene.task().arms[0]), samples), 0
    for roll, row, column in cells:
        situation, poses = approach(
            scene, float(m.manifold.h[row]), float(m.manifold.theta[column]), ROLLS[roll], 0.15
        )
        expected = exhaustive(situation, solver, poses)
        if not expected:
            with pytest.raises(NoMotionError):
                follow([Leg(situation, poses)], solver)
            continue
        tree = follow([Leg(situation, poses)], solver)
        found = {tuple(q.round(7)): value for q, value in zip(tree.ends, tree.value, strict=True)}
        assert found == pytest.approx(expected, abs=1e-9)
        compared += min(found.values()) < CLEAR
    assert compared


def poured(scene: Scene) -> tuple[Situation, list[Array]]:
    """Return a hand that is lifted and then tips what it would hold by 60 degrees."""
    situation, poses = approach(scene, 0.1, np.pi, 0.0, 0.1)
    up = translation([0, 0, 0.15]) @ poses[0]
    tipped = up.copy()
    tipped[:3, :3] = up[:3, :3] @ rotation_about([0, 0, 1], np.deg2rad(60))
    return situation, [*straight(poses[0], up), *straight(up, tipped)[1:]]


@pytest.mark.parametrize("path", ["approach", "pour"])
def test_a_way_follows_the_path_turns_no_joint_far_and_is_as_clear_as_it_says(path):
    scene = load_small("bottle_on_table")
    arm = scene.arm()
    situation, poses = poured(scene) if path == "pour" else approach(scene, 0.1, np.pi, 0.0, 0.1)
    tree = follow([Leg(situation, poses)], solver_for(arm, 72))
    assert len(tree.ends) > 1
    for end in range(0, len(tree.ends), 3):
        rows = tree.path(end)
        distance, angle = pose_error(arm.world_tool_pose(rows), np.array(poses))
        assert max(distance.max(), angle.max()) < 1e-6
        halves = np.array([middle(a, b) for a, b in pairwise(poses)])
        distance, angle = pose_error(arm.world_tool_pose(0.5 * (rows[1:] + rows[:-1])), halves)
        assert (distance + 0.1 * angle).max() <= OFF
        assert np.abs(np.diff(rows, axis=0)).max() <= LARGEST_TURN
        assert ((rows >= arm.lower) & (rows <= arm.upper)).all()
        proof = prove(situation, rows[:-1], rows[1:], CLEAR)
        assert proof.free.all()
        assert proof.clearance.min() == pytest.approx(tree.value[end], abs=1e-12)


def with_box(scene: Scene, size: Sequence[float], position: Array) -> Scene:
    content: dict[str, Any] = scene.content
    box = {"name": "box", "box": list(size), "pose": {"position": position.tolist()}}
    return Scene.from_content({**content, "obstacles": [*content["obstacles"], box]})


def test_it_is_said_at_which_share_of_the_path_and_at_what_every_way_ends():
    scene = load_small("bottle_on_table")
    arm = scene.arm()
    solver = solver_for(arm, 72)
    _, poses = approach(scene, 0.1, np.pi, 0.0, 0.2)
    away = poses[::-1]
    # A plate across the way back, behind the hand where it holds the bottle.
    plate = away[0][:3, 3] - 0.35 * away[0][:3, 2]
    situation, _ = approach(with_box(scene, (0.01, 0.1, 0.1), plate), 0.1, np.pi, 0.0, 0.2)
    with pytest.raises(NoMotionError, match=r"it ends at \d+ % of its length: panda/\w+ meets box") as error:
        follow([Leg(situation, away)], solver)
    share = float(str(error.value).split(" % ")[0].split()[-1]) / 100
    steps = round(share * (len(away) - 1))
    assert 1 < steps < len(away) - 1
    follow([Leg(situation, away[:steps])], solver)  # up to the sample before it goes on
    with pytest.raises(NoMotionError, match=r"it ends at 100 % of its length: panda/\w+ meets box"):
        follow([Leg(situation, away[: steps + 1])], solver)

    free, poses = approach(scene, 0.1, np.pi, 0.0, 0.1)
    far = straight(poses[0], translation([0, 0, 1.5]) @ poses[0])
    with pytest.raises(NoMotionError, match=r"it ends at \d+ % .*: no joint values go on from there"):
        follow([Leg(free, far)], solver)
    low = straight(translation([0, 0, -0.2]) @ poses[0], poses[0])
    with pytest.raises(NoMotionError, match=r"its start is not free: panda/\w+ meets table"):
        follow([Leg(free, low)], solver)


@pytest.mark.parametrize("name", ["pick_pour_place", "bottle_on_table", "ur5_bottle"])
def test_a_grasp_of_a_map_with_an_approach_has_one_way_without_jumps(name):
    """So what refuses a grasp for its straight approach may advise to ask maps for one."""
    length = 0.1
    scene = load_small(name, 12, 16, 8).with_settings(approach=length)
    arm, m = scene.arm(), create_map(scene)
    coarse, fine = solver_for(arm, 8), solver_for(arm, 72)
    cells = np.random.default_rng(2).permutation(np.argwhere(m.feasible))[:10]
    assert len(cells) == 10
    for roll, row, column in cells:
        situation, poses = approach(
            scene, float(m.manifold.h[row]), float(m.manifold.theta[column]), ROLLS[roll], length
        )
        ends = configurations(coarse, poses[-1])
        assert len(follow([Leg(situation, poses)], fine, end=ends).ends)
