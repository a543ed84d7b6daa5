"""Calls of the compiled code of this room: proofs of lines, and free motion between configurations."""

from __future__ import annotations

from collections import Counter
from typing import NamedTuple

import numpy as np

from symgrasp.errors import NoPlanError
from symgrasp.motion.bodies.situation import Situation
from symgrasp.motion.paths.proof import FALLEN, TILTED, clearances
from symgrasp.motion.paths.trees import Trees, drop_points, grow, new_trees, shorten
from symgrasp.poses import Array
from symgrasp.progress import Progress, at_start, between, portions

__all__ = [
    "STATED",
    "FoundPath",
    "NoMotionError",
    "Proof",
    "blockers",
    "connect",
    "find",
    "prove",
    "shortened",
]

STATED = 0.05
"""Clearances of motions are proven up to this distance (m)."""

ROOM = ((0.01, 1_000), (0.003, 2_000), (0.0, 60_000))
"""By how much more (m) than they must bodies keep apart in free motions, if such a motion is found in so many
samples: the corners of the path are rounded later, and arms do not follow it exactly."""

TRIES = 150
"""Lines that are tried to shorten a path."""


class NoMotionError(NoPlanError):
    """A part of a motion was not found; the text says which, and what is in its way."""


class Proof(NamedTuple):
    """What is proven of E lines.

    Attributes:
        clearance: (E,) distance (m) that bodies keep at least; negative for lines without a proof.
        room: (E,) how far (m) any point may be off the line, besides, before the object sinks into what it
            rests on, or a robot falls.
        hits: (E, 2) the pair of pieces that each line without a proof meets, see `blockers`.
    """

    clearance: Array
    room: Array
    hits: np.ndarray

    @property
    def free(self) -> np.ndarray:
        """Whether each line (E,) is proven free."""
        return self.clearance >= 0


def prove(
    situation: Situation, start: Array, end: Array, most: float = 0.0, progress: Progress | None = None
) -> Proof:
    """Prove that lines are free.

    Args:
        situation: what moves and stands.
        start: (E, J) joint values.
        end: (E, J) joint values.
        most: clearance (m) above which it need not be known.
        progress: called with the finished share; may raise `Cancelled`.
    """
    s = situation
    found, hits = np.empty((len(start), 2)), np.full((len(start), 2), -1, dtype=np.int64)
    start, end = np.ascontiguousarray(start, dtype=float), np.ascontiguousarray(end, dtype=float)
    for some in portions(len(start), progress):
        clearances(
            s.linkage, s.pieces, s.tree, s.work, start[some], end[some], float(most), found[some], hits[some]
        )
    return Proof(found[:, 0], found[:, 1], hits)


def blockers(situation: Situation, hits: np.ndarray) -> str:
    """Return in words what lines meet most often.

    Args:
        situation: what moves and stands.
        hits: (., 2) pairs of pieces, or `TILTED` or `FALLEN` twice.
    """
    if not len(hits):
        return "no configuration reaches it"
    ((a, b), _) = Counter(map(tuple, np.asarray(hits).tolist())).most_common(1)[0]
    if a < 0:
        return {TILTED: "the object would be tilted too far", FALLEN: "the robot would fall"}[a]
    return f"{situation.names[a]} meets {situation.names[b]}"


class FoundPath(NamedTuple):
    """A path as the search found it, before it is shortened.

    Attributes:
        situation: what moves and stands, with the room that all lines of the path have.
        rows: (n, J) joint values; all lines between them are proven free.
        random: (1,) state of the random numbers.
    """

    situation: Situation
    rows: Array
    random: np.ndarray


def connect(
    situation: Situation, starts: Array, goals: Array, seed: int = 0, progress: Progress | None = None
) -> Array:
    """Find a free path from one of some configurations to one of others, and shorten it.

    Args:
        situation: what moves and stands.
        starts: (., J) joint values.
        goals: (., J) joint values.
        seed: of the random numbers; the same one gives the same path.
        progress: called now and then; may raise `Cancelled`.

    Returns:
        The path (n, J), all lines of it proven free.

    Raises:
        NoMotionError: none was found; says what is in the way most.
    """
    return shortened(find(situation, starts, goals, seed, progress), progress)


def find(
    situation: Situation, starts: Array, goals: Array, seed: int = 0, progress: Progress | None = None
) -> FoundPath:
    """Find a free path from one of some configurations to one of others; see `connect`."""
    s, tell = situation, at_start(progress)
    for roots, what in ((starts, "start"), (goals, "end")):
        proof = prove(s, roots, roots, progress=tell)
        if not proof.free.any():
            raise NoMotionError(f"its {what} is in collision: {blockers(s, proof.hits)}")
    met, taken = np.zeros(len(s.names), dtype=np.int64), 0
    for room, samples in ROOM:
        wide = s.with_room(room)
        first, second = (roots[prove(wide, roots, roots, progress=tell).free] for roots in (starts, goals))
        if not len(first) or not len(second):
            continue
        trees = new_trees(first, second, len(s.names), seed)
        low, high = _sampled(s, np.concatenate([first, second]))
        for some in portions(samples, progress):
            count = some.stop - some.start
            if grow(wide.linkage, s.pieces, s.tree, s.work, trees, low, high, count):
                if progress:
                    progress(some.stop / samples)
                return FoundPath(wide, _joined(trees), trees.random)
        met, taken = trees.met[: len(s.names)], samples
    most = met.argsort()[::-1][:2]
    names = " and ".join(dict.fromkeys(str(s.names[k]) for k in most if met[k]))
    text = f"no way was found in {taken:,} samples"
    raise NoMotionError(f"{text}; mostly in the way: {names}" if names else text)


def shortened(path: FoundPath, progress: Progress | None = None) -> Array:
    """Return a path (n, J) that is no longer than one that was found, all lines of it proven free.

    Args:
        path: the path that was found.
        progress: called with the finished share; may raise `Cancelled`.
    """
    s = path.situation
    rows = np.empty((len(path.rows) + 2 * TRIES, path.rows.shape[1]))
    rows[: len(path.rows)] = path.rows
    count, idle = len(path.rows), 0
    for some in portions(TRIES, between(progress, 0.0, 0.5)):
        tries = some.stop - some.start
        count, idle = shorten(s.linkage, s.pieces, s.tree, s.work, rows, count, path.random, tries, idle)
    before = 0
    for some in portions(count, between(progress, 0.5, 1.0)):
        tries = some.stop - some.start
        count, before = drop_points(s.linkage, s.pieces, s.tree, s.work, rows, count, before, tries)
    return rows[:count].copy()


def _sampled(situation: Situation, roots: Array) -> tuple[Array, Array]:
    """Return the range (J,), (J,) of joint values that are sampled; half a turn each way without limits."""
    low, high = situation.linkage.limits
    return (
        np.where(np.isfinite(low), low, roots.min(axis=0) - np.pi),
        np.where(np.isfinite(high), high, roots.max(axis=0) + np.pi),
    )


def _joined(trees: Trees) -> Array:
    """Return the path through two trees that meet."""
    halves = []
    for side in (0, 1):
        k, half = int(trees.meet[side]), []
        while k >= 0:
            half.append(trees.node[side, k])
            k = int(trees.parent[side, k])
        halves.append(half)
    path = np.array(halves[0][::-1] + halves[1])
    apart = np.linalg.norm(np.diff(path, axis=0), axis=1) > 1e-9
    return path[np.concatenate([[True], apart])]
