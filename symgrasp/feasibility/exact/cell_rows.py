"""What the boxes of heights and angles need for which cells are proven: how the hand changes in them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from symgrasp.collision.pieces import PackedPieces
from symgrasp.engine.cell_types import Rows
from symgrasp.engine.geometry import hand_poses
from symgrasp.feasibility.fit import fits_all, fits_none
from symgrasp.object.manifold import Manifold
from symgrasp.poses import Array
from symgrasp.robot.hand import JointTable
from symgrasp.robot.robot import Arm

__all__ = ["new_rows"]


def new_rows(
    arm: Arm, manifold: Manifold, levels: int, links: Sequence[str], pieces: PackedPieces
) -> tuple[Rows, np.ndarray, Array]:
    """Return the rows of boxes of a grid.

    Args:
        arm: the arm.
        manifold: the grid.
        levels: how often a cell may be cut in two, along and around.
        links: (G,) the links of the first pieces, which are fixed to the tool.
        pieces: the pieces.

    Returns:
        The rows, where those of each level begin (levels + 1,), and the openings (m) in their middles.
    """
    profile, hand = manifold.profile, arm.hand
    count = [manifold.heights << level for level in range(levels + 1)]
    half = np.concatenate([np.full(n, 0.5 * (profile.h_max - profile.h_min) / n) for n in count])
    index = np.concatenate([np.arange(n) for n in count])
    h = np.asarray(profile.h_min + (2 * index + 1) * half, dtype=float)
    span = np.array([profile.radius_span(a, b) for a, b in zip(h - half, h + half, strict=True)])
    opening = np.array([hand.opening(float(r)) for r in profile.radius(h)])
    between = np.array([[hand.opening(float(r)) for r in row] for row in span])
    shift = hand.shift_at(profile.radius(h))
    standoff = np.array([hand.standoff(float(r)) for r in profile.radius(h)])
    ends = np.array([[hand.standoff(float(r)) for r in row] for row in span])
    turns = {name: _changes(table, opening, between) for name, table in hand.joints.items()}
    radii = _radii(pieces)[: len(links)]
    play = [_play(arm, turns, link, r, len(h)) for link, r in zip(links, radii, strict=True)]
    rows = Rows(
        h=h,
        dh=half,
        standoff=standoff,
        dstandoff=np.abs(ends - standoff[:, None]).max(axis=1),
        shift=np.ascontiguousarray(shift, dtype=float),
        dshift=_changes(hand.shift, opening, between),
        hand=hand_poses(arm, list(links), opening),
        play=np.ascontiguousarray(np.reshape(play, (len(links), len(h))).T),
        sway=_sway(arm, turns, len(h)),
        fits=np.array([fits_all(hand, profile, a, b) for a, b in zip(h - half, h + half, strict=True)]),
        misfits=np.array([fits_none(hand, profile, a, b) for a, b in zip(h - half, h + half, strict=True)]),
    )
    return rows, np.concatenate([[0], np.cumsum(count)[:-1]]).astype(np.int64), opening


def _changes(table: JointTable, at: Array, between: Array) -> Array:
    """Return by how much (rows,) a table changes at most from openings (rows,) to others (rows, 2)."""
    if isinstance(table, float | int):
        return abs(table) * np.abs(between - at[:, None]).max(axis=1)
    knots, values = np.transpose(table)
    here = np.interp(at, knots, values)[:, None]
    changes = np.abs(np.interp(between, knots, values) - here).max(axis=1)
    inside = (knots > between[:, :1]) & (knots < between[:, 1:])
    return np.maximum(changes, np.where(inside, np.abs(values - here), 0.0).max(axis=1))


def _radii(pieces: PackedPieces) -> Array:
    """Return how far (m) points of the pieces are from the origins of their links, at most."""
    return (
        np.linalg.norm(pieces.size[:, 3:6], axis=1)
        + np.linalg.norm(pieces.size[:, 6:9], axis=1)
        + pieces.size[:, 0]
    )


def _play(arm: Arm, turns: dict[str, Array], link: str, away: float, rows: int) -> Array:
    """Return how far (rows,) (m) a point of a link moves at most as joints of the hand change.

    Args:
        arm: the arm.
        turns: name of the joint → by how much it changes (rows,).
        link: the link.
        away: how far (m) the point is from the link's origin.
        rows: their number.
    """
    model = arm.robot.model
    total = np.zeros(rows)
    for joint in reversed(model.chain(link)):
        slides = joint.kind == "prismatic"
        name = model.joint_names[joint.source] if joint.source >= 0 else ""
        if name in turns:
            total = total + abs(joint.ratio) * turns[name] * (1.0 if slides else away)
        away += float(np.linalg.norm(joint.origin[:3, 3]))
        if slides:
            away += max(abs(joint.lower), abs(joint.upper))
    return total


def _sway(arm: Arm, turns: dict[str, Array], rows: int) -> Array:
    """Return how far (rows,) (m) the centre of mass of the hand moves at most as its joints change."""
    model = arm.robot.model
    if arm.robot.support is None:  # then no weight matters
        return np.zeros(rows)
    away = np.linalg.norm(model.masses()[1], axis=1)
    last = arm.joint_names[-1]
    links = [
        (k, link) for k, link in enumerate(model.link_names) if last in {j.name for j in model.chain(link)}
    ]
    return np.max([_play(arm, turns, link, float(away[k]), rows) for k, link in links], axis=0, initial=0.0)
