"""What is certified of a path at once is what its steps say one by one."""

from __future__ import annotations

import math

import numpy as np
import pytest

from symgrasp.collision.distance import distance_bounds
from symgrasp.collision.pieces import pose_rows
from symgrasp.compiling import ENTRY, njit
from symgrasp.engine.checks import FREE_BAND, HIT_BAND, UNDECIDED
from symgrasp.engine.geometry import ArmGeometry, arm_geometry
from symgrasp.engine.kinematics import Scratch, new_scratch, place_arm, place_frames, place_hand
from symgrasp.engine.path_checks import check_path_of_arm, check_path_of_hand, write_tool
from symgrasp.engine.search_types import Path
from symgrasp.poses import axis_frame
from symgrasp.robot.robot import Arm
from symgrasp.scene.scene import Scene
from symgrasp.world import BulletWorld
from tests.conftest import load_small

ROW = 3

compiled_bounds = njit(**ENTRY)(distance_bounds)


@njit(**ENTRY)
def check_path(moving, pieces, tree, scratch, path, T_world_base, T, row, q, margin):
    """Check a path of joint values (s, n) and tool poses (s, 4, 4) in the base; return both results."""
    for s in range(len(q)):
        place_frames(moving, q[s], path.frames[s])
        place_hand(moving, pieces, scratch, T_world_base, T[s], row)
        write_tool(scratch, path, s)
    place_hand(moving, pieces, scratch, T_world_base, T[len(q) // 2], row)
    hand = check_path_of_hand(moving, pieces, tree, scratch, path, row, margin)
    place_hand(moving, pieces, scratch, T_world_base, T[len(q) // 2], row)
    return hand, check_path_of_arm(moving, pieces, tree, scratch, path, row, margin)


@njit(**ENTRY)
def place(moving, pieces, scratch, T_world_base, T, row, q):
    place_hand(moving, pieces, scratch, T_world_base, T, row)
    place_arm(moving, pieces, scratch, q)


@pytest.mark.parametrize("name", ["bottle_on_table", "handover_between_robots", "ur5_bottle"])
def test_paths_are_as_free_as_their_steps(name):
    """Straight paths in joint space, on which the hand turns too: so its motion is that of its pieces."""
    scene = load_small(name)
    arm = scene.arm(scene.task().arms[0])
    rng = np.random.default_rng(0)
    seen: dict[str, int] = dict.fromkeys(("free", "blocked", "open"), 0)
    with BulletWorld(scene) as world:
        geometry = geometry_of(world, scene, arm)
        for _ in range(150):
            steps = int(rng.integers(1, 9))
            start, way = rng.uniform(arm.lower, arm.upper), rng.normal(0, rng.choice([0.003, 0.03]), arm.dof)
            compare(scene, arm, geometry, start + np.outer(np.arange(steps), way), seen)
    assert min(seen["free"], seen["blocked"]) > 20, seen


def geometry_of(world: BulletWorld, scene: Scene, arm: Arm) -> ArmGeometry:
    openings = np.array([arm.hand.opening(float(r)) for r in scene.profile.radius(scene.manifold.h)])
    world.set_arms([(arm, arm.home, float(openings[0]))])
    geometry = arm_geometry(world, arm, openings)
    geometry.pose[geometry.moving.objects] = pose_rows(axis_frame(scene.task().T_world_object))
    return geometry


def compare(scene: Scene, arm: Arm, geometry: ArmGeometry, q: np.ndarray, seen: dict[str, int]) -> None:
    moving, pieces, margin = geometry.moving, geometry.pieces, scene.settings.margin
    base, middle, tools = arm.robot.T_world_base, len(q) // 2, np.array([arm.tool_pose(row) for row in q])
    scratch = new_scratch(geometry.pose, pieces.size, arm.dof)
    path = Path(
        frames=np.empty((len(q), arm.dof, 12)),
        tool=np.empty((len(q), 12)),
        motion=np.zeros(len(moving.frame)),
        q=q.copy(),
        blocked=np.zeros(2, dtype=np.int64),
    )
    poses = [placed(geometry, scratch, base, T, row) for T, row in zip(tools, q, strict=True)]
    corners = [corners_at(geometry, pose) for pose in poses]
    motion = [max(np.linalg.norm(c[k] - corners[middle][k], axis=1).max() for c in corners)
              for k in range(len(moving.frame))]  # fmt: skip
    hands = moving.hand.shape[1]
    path.motion[:hands] = np.array(motion[:hands]) + pieces.size[:hands, 0]
    hand, links = check_path(moving, pieces, geometry.tree, scratch, path, base, tools, ROW, q, float(margin))
    assert (path.motion[hands:] >= np.array(motion[hands:]) - 1e-9).all()
    for result, of_hand in ((hand, True), (links, False)):
        sure, deep = bounds_of(geometry, scratch, poses, pairs_of(geometry, of_hand), margin)
        if result == -math.inf:
            seen["blocked"] += 1
            assert deep < -HIT_BAND + 1e-6
        elif result == UNDECIDED:
            seen["open"] += 1
            assert sure < FREE_BAND + 1e-6
            assert deep >= -HIT_BAND - 1e-6
        else:
            seen["free"] += 1
            assert sure >= FREE_BAND - 1e-6


def placed(geometry: ArmGeometry, scratch: Scratch, base: np.ndarray, T: np.ndarray, q: np.ndarray):
    place(geometry.moving, geometry.pieces, scratch, base, T, ROW, q)
    return scratch.pose.copy()


def corners_at(geometry: ArmGeometry, pose: np.ndarray) -> list[np.ndarray]:
    """The vertices of the moving pieces in the world."""
    found = []
    for k in range(len(geometry.moving.frame)):
        first, end, _ = geometry.pieces.ranges[k]
        found.append(geometry.pieces.vertices[first:end] @ pose[k, :9].reshape(3, 3).T + pose[k, 9:])
    return found


def pairs_of(geometry: ArmGeometry, of_hand: bool) -> list[tuple[int, int, bool]]:
    """The pairs that are checked, and whether the second piece is a static one."""
    moving, hands = geometry.moving, geometry.moving.hand.shape[1]
    static = [int(k) for k in geometry.tree.piece if k >= 0]
    if of_hand:
        own = [(int(a), int(b), False) for a, b in moving.base_pairs]
        return own + [(k, i, True) for k in range(hands) for i in static]
    own = [(int(a), int(b), False) for a, b in moving.arm_pairs]
    links = range(hands, len(moving.frame))
    own += [(k, int(i), False) for k in links if not moving.touch[k] for i in moving.objects]
    return own + [(k, i, True) for k in links for i in static]


def bounds_of(geometry: ArmGeometry, scratch: Scratch, poses, pairs, margin: float) -> tuple[float, float]:
    """The bounds on the distance of the true shapes over what they have to keep, of the nearest pair."""
    sure = deep = math.inf
    for pose in poses:
        for a, b, static in pairs:
            lower, upper = compiled_bounds(
                geometry.pieces, pose, a, b, math.inf, math.inf, -math.inf, scratch.simplex
            )
            keep = margin if static else 0.0
            sure = min(sure, lower - keep)
            deep = min(deep, upper + geometry.pieces.size[[a, b], 1].sum() - keep)
    return sure, deep
