"""The complete search for grasps that go together, compiled: branch and bound over sets of columns.

A *line* is a roll and a row (roll · heights + row). A placement gives each of n holds a line and a
column; the first hold's column is 0, since turning all together changes nothing. Its score is the
smallest of three things: what each line reaches alone, the gaps between prints, and for each group
of tasks with one turn the margins of all holds in it, at the best turn.

Sets of columns are words of bits. For a floor that the score must exceed, a pair of lines allows
the columns at which their gap exceeds it, and a group the turns at which the margins do; a hold is
placed where all earlier ones allow it, and given up as soon as a later one has no place left.

Where it was found that two arms cannot hold at their columns and a turn, whatever all others do, no
placement is given that leaves a group no other turn.

Where arms of a group share a torso they must have one value of it as well: they are a *station* of the
group, with a set of turns for each value. The turns left to a group are those that each of its stations has
at some value.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from symgrasp.compiling import ENTRY, njit
from symgrasp.ik.vectors import STRICT
from symgrasp.planners.column_sets import (
    WORD,
    copy_set,
    doubled_words,
    fill_above,
    intersect,
    take_first,
    word_count,
)
from symgrasp.planners.ruled_out import RuledOut
from symgrasp.poses import Array

__all__ = ["Problem", "best_placement", "placements_of"]


class Problem(NamedTuple):
    """What is to be placed: n holds, L lines, A angles, S stations, T values of a torso at most.

    Attributes:
        order: (n, L) the lines of each hold, most promising first.
        alone: (n, L) what a line reaches at most, whatever the others do; below 0 if infeasible.
        feasible: (G, n, L, D) the columns, twice in a row, at which a hold is feasible in each of G groups;
            all where it is not in it.
        group: (S,) group of each station, from 0 on; groups of a single hold have none.
        part: (n, S) where in ``margins`` a hold's margins in a station are, -1 if it is not in it.
        margins: (P, T, L, A) margins (m), below 0 where infeasible.
        table: (n, n) which of the tables of gaps two holds a < b have, -1 if they never meet.
        row: (T, L, L) where in ``gaps`` a pair of lines is.
        gaps: (K, A) gaps (m) by the later hold's column less the earlier one's.
    """

    order: np.ndarray
    alone: Array
    feasible: np.ndarray
    group: np.ndarray
    part: np.ndarray
    margins: Array
    table: np.ndarray
    row: np.ndarray
    gaps: Array


class _Sets(NamedTuple):
    """The columns above the floor, of every line's margins (P · T · L) and every row of gaps (K).

    Each set is written twice in a row, so that it can be read from any column; it is made when it
    is first asked for, and again when the floor has changed.
    """

    margins: np.ndarray
    margins_made: np.ndarray
    gaps: np.ndarray
    gaps_made: np.ndarray


class _Memory(NamedTuple):
    """What a search writes to, for n holds, L lines, S stations, T values of a torso, and sets of W words.

    Attributes:
        sets: the columns above the floor.
        at: (n,) where in its order a hold is.
        columns: (n, W) the columns of that line still to be tried.
        allowed: (n, n, L, W) by depth: the columns that earlier holds allow the later ones.
        turns: (n + 1, S, T, W) by depth: the turns that they leave each station.
        open: (n + 1, G, W) by depth: the turns at which a group is feasible and nothing is ruled out.
        left: (W,) scratch.
        reached: (n + 1,) by depth: what they reach.
        place: (n, 2) line and column of each hold.
    """

    sets: _Sets
    at: np.ndarray
    columns: np.ndarray
    allowed: np.ndarray
    turns: np.ndarray
    open: np.ndarray
    left: np.ndarray
    reached: Array
    place: np.ndarray


def best_placement(
    problem: Problem, ruled_out: RuledOut, floor: float, ceiling: float
) -> tuple[np.ndarray, float] | None:
    """Return the first of the best placements whose score is above a floor and below a ceiling.

    Args:
        problem: what is to be placed.
        ruled_out: what was found to be impossible.
        floor: what the score must exceed.
        ceiling: what the score must stay below.

    Returns:
        Line and column of each hold (n, 2), and the score; None if there is no such placement.
    """
    place = np.empty((len(problem.order), 2), dtype=np.int64)
    memory = _new_memory(problem)
    found, score, _ = _explore(problem, ruled_out.table, floor, ceiling, True, place, memory, 0)
    return (place, score) if found else None


def placements_of(problem: Problem, ruled_out: RuledOut, score: float) -> Iterator[np.ndarray]:
    """Yield all placements (n, 2) of a score; what is ruled out meanwhile counts for those that follow."""
    above, below = float(np.nextafter(score, -np.inf)), float(np.nextafter(score, np.inf))
    memory, depth = _new_memory(problem), 0
    while depth >= 0:
        place = np.empty((len(problem.order), 2), dtype=np.int64)
        found, _, depth = _explore(problem, ruled_out.table, above, below, False, place, memory, depth)
        if found:
            yield place


def _new_memory(problem: Problem) -> _Memory:
    """Return the memory of a search that has not begun."""
    holds, lines = problem.order.shape
    angles, stations = problem.gaps.shape[1], problem.part.shape[1]
    parts, torsos = problem.margins.shape[:2]
    words = word_count(angles)
    count, double = parts * torsos * lines, doubled_words(angles)
    all_columns = np.full(words, ~np.uint64(0))
    all_columns[-1] >>= np.uint64(WORD * words - angles)
    memory = _Memory(
        _Sets(
            np.empty((count, double), np.uint64),
            np.full(count, -1),
            np.empty((len(problem.gaps), double), np.uint64),
            np.full(len(problem.gaps), -1),
        ),
        at=np.full(holds, -1),
        columns=np.zeros((holds, words), np.uint64),
        allowed=np.empty((holds, holds, lines, words), np.uint64),
        turns=np.empty((holds + 1, stations, torsos, words), np.uint64),
        open=np.empty((holds + 1, len(problem.feasible), words), np.uint64),
        left=np.empty(words, np.uint64),
        reached=np.full(holds + 1, np.inf),
        place=np.zeros((holds, 2), np.int64),
    )
    # Turning all of them changes nothing, so the first has column 0.
    memory.allowed[0, 0] = np.arange(words) == 0
    memory.allowed[0, 1:] = all_columns
    memory.turns[0] = memory.open[0] = all_columns
    return memory


@njit(**ENTRY)
def _explore(problem, ruled_out, floor, ceiling, improve, best, memory, depth):
    """Find the first best placement, or the next one.

    Args:
        problem: what is to be placed.
        ruled_out: see `Table`.
        floor: what the score must exceed.
        ceiling: what the score must stay below.
        improve: raise the floor to each score that is found, so that the last is the first of the best.
        best: (n, 2) receives line and column of each hold.
        memory: that `_new_memory` returned, or that the search has written to up to the placement before.
        depth: 0, or what it returned then.

    Returns:
        Whether a placement was found, its score, and the depth to go on from, -1 at the end.
    """
    holds, lines = problem.order.shape
    sets, at, columns, allowed, turns, opened, left, reached, place = memory
    made, found, score = 0, False, floor
    depth = _resume(problem, ruled_out, memory, depth)
    while depth >= 0:
        column = take_first(columns[depth])
        if column < 0:
            at[depth] += 1
            line = problem.order[depth, min(at[depth], lines - 1)]
            if at[depth] == lines or min(problem.alone[depth, line], reached[depth]) <= floor:
                at[depth] = -1  # the lines that follow are no better
                depth -= 1
            else:
                copy_set(allowed[depth, depth, line], columns[depth])
            continue
        line = problem.order[depth, at[depth]]
        place[depth, 0], place[depth, 1] = line, column
        here = min(reached[depth], problem.alone[depth, line], _gap(problem, place, depth))
        if here <= floor or not _turn(problem, sets, made, floor, place, depth, turns, left):
            continue
        if not _is_open(problem, ruled_out, place, depth, opened):
            continue
        if depth < holds - 1:
            reached[depth + 1] = here
            if _narrow(problem, sets, made, floor, place, depth, allowed):
                depth += 1
            continue
        here = min(here, _together(problem, place, turns[holds], left))
        if not floor < here < ceiling:
            continue
        found, score = True, here
        for d in range(holds):
            best[d, 0], best[d, 1] = place[d, 0], place[d, 1]
        if not improve:
            break
        floor = here
        made += 1
        for d in range(holds):  # above the new floor fewer turns are left
            _turn(problem, sets, made, floor, place, d, turns, left)
    return found, score, depth


@njit(**STRICT)
def _resume(problem, ruled_out, memory, depth):
    """Return the depth to go on from: that of the first hold that meanwhile leaves a group no turn."""
    for d in range(depth):
        if not _is_open(problem, ruled_out, memory.place, d, memory.open):
            for later in range(d + 1, len(memory.at)):
                memory.at[later] = -1
                for w in range(memory.columns.shape[1]):
                    memory.columns[later, w] = 0
            return d
    return depth


@njit(**STRICT)
def _is_open(problem, ruled_out, place, depth, opened):
    """Leave each group the turns at which the hold is feasible too, and goes with those before it.

    Returns:
        Whether all groups have a turn left.
    """
    line, column = place[depth, 0], place[depth, 1]
    angles = problem.gaps.shape[1]
    for g in range(opened.shape[1]):
        after = opened[depth + 1, g]
        any_left = intersect(opened[depth, g], problem.feasible[g, depth, line], column, after)
        for other in range(depth):
            table = ruled_out.pair[g, other, depth]
            if any_left and table >= 0:
                apart = (column - place[other, 1]) % angles
                row = ruled_out.row[table, place[other, 0], line, apart]
                if row >= 0:
                    any_left = intersect(after, ruled_out.left[row], place[other, 1], after)
        if not any_left:
            return False
    return True


@njit(**STRICT)
def _gap(problem, place, depth):
    """Return the smallest gap from a hold to those before it."""
    smallest = np.inf
    for other in range(depth):
        table = problem.table[other, depth]
        if table >= 0:
            gaps = problem.gaps[problem.row[table, place[other, 0], place[depth, 0]]]
            smallest = min(smallest, gaps[(place[depth, 1] - place[other, 1]) % len(gaps)])
    return smallest


@njit(**STRICT)
def _turn(problem, sets, made, floor, place, depth, turns, left):
    """Leave each station the turns at which the hold is above the floor as well.

    Returns:
        Whether all groups have a turn left; ``left`` (words,) is scratch.
    """
    line, column = place[depth, 0], place[depth, 1]
    _, torsos, lines, _ = problem.margins.shape
    for s in range(len(problem.group)):
        part = problem.part[depth, s]
        if part < 0:
            for t in range(torsos):
                copy_set(turns[depth, s, t], turns[depth + 1, s, t])
            continue
        any_left = False
        for t in range(torsos):
            i = (part * torsos + t) * lines + line
            if sets.margins_made[i] != made:
                fill_above(sets.margins[i], problem.margins[part, t, line], floor)
                sets.margins_made[i] = made
            any_left |= intersect(turns[depth, s, t], sets.margins[i], column, turns[depth + 1, s, t])
        if not any_left:
            return False
    for s in range(len(problem.group)):
        first = s == 0 or problem.group[s] != problem.group[s - 1]
        if first and not _turns_left(problem, turns[depth + 1], problem.group[s], left):
            return False
    return True


@njit(**STRICT)
def _turns_left(problem, turns, group, left):
    """Write the turns that each station of a group has at some value; tell whether there are any."""
    anything = False
    for w in range(len(left)):
        left[w] = ~np.uint64(0)
        for s in range(len(problem.group)):
            if problem.group[s] == group:
                bits = np.uint64(0)
                for t in range(turns.shape[1]):
                    bits |= turns[s, t, w]
                left[w] &= bits
        anything |= left[w] != 0
    return anything


@njit(**STRICT)
def _narrow(problem, sets, made, floor, place, depth, allowed):
    """Leave each later hold the columns that the hold allows; tell whether all have one."""
    holds, lines = problem.order.shape
    angles = problem.gaps.shape[1]
    for other in range(depth + 1, holds):
        table, any_left = problem.table[depth, other], False
        for k in range(lines):
            line = problem.order[other, k]
            if problem.alone[other, line] <= floor:
                break
            before, after = allowed[depth, other, line], allowed[depth + 1, other, line]
            if table < 0:
                copy_set(before, after)
                any_left = True
                continue
            i = problem.row[table, place[depth, 0], line]
            if sets.gaps_made[i] != made:
                fill_above(sets.gaps[i], problem.gaps[i], floor)
                sets.gaps_made[i] = made
            any_left |= intersect(before, sets.gaps[i], (angles - place[depth, 1]) % angles, after)
        if not any_left:
            return False
    return True


@njit(**STRICT)
def _together(problem, place, turns, left):
    """Return the margin of the worst group at its best turn; ``left`` (words,) is scratch."""
    worst = np.inf
    for s in range(len(problem.group)):
        if s and problem.group[s] == problem.group[s - 1]:
            continue
        best = -np.inf
        _turns_left(problem, turns, problem.group[s], left)
        turn = take_first(left)
        while turn >= 0:
            margin = np.inf
            for other in range(s, len(problem.group)):
                if problem.group[other] == problem.group[s]:
                    margin = min(margin, _station_margin(problem, place, other, turn))
            best = max(best, margin)
            turn = take_first(left)
        worst = min(worst, best)
    return worst


@njit(**STRICT)
def _station_margin(problem, place, station, turn):
    """Return the smallest margin of a station's holds at a turn, at the best value of the torso."""
    best = -np.inf
    for t in range(problem.margins.shape[1]):
        margin = np.inf
        for d in range(len(place)):
            part = problem.part[d, station]
            if part >= 0:
                column = (place[d, 1] + turn) % problem.gaps.shape[1]
                margin = min(margin, problem.margins[part, t, place[d, 0], column])
        best = max(best, margin)
    return best
