"""The complete search for grasps that go together, compiled: branch and bound over sets of columns.

A *line* is a roll and a row (roll · heights + row). A placement gives each of n holds a line and a
column; the first hold's column is 0, since turning all together changes nothing. Its score is the
smallest of three things: what each line reaches alone, the gaps between prints, and for each group
of tasks with one turn the margins of all holds in it, at the best turn.

Sets of columns are words of bits. For a floor that the score must exceed, a pair of lines allows
the columns at which their gap exceeds it, and a group the turns at which the margins do; a hold is
placed where all earlier ones allow it, and given up as soon as a later one has no place left.

Where arms of a group share a torso they must have one value of it as well: they are a *station* of the
group, with a set of turns for each value. The turns left to a group are those that each of its stations has
at some value.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from symgrasp.compiling import ENTRY, njit
from symgrasp.ik.vectors import STRICT
from symgrasp.poses import Array

__all__ = ["Problem", "explore"]

WORD = 64
"""Bits of a word."""


class Problem(NamedTuple):
    """What is to be placed: n holds, L lines, A angles, S stations, T values of a torso at most.

    Attributes:
        order: (n, L) the lines of each hold, most promising first.
        alone: (n, L) what a line reaches at most, whatever the others do; below 0 if infeasible.
        group: (S,) group of each station, from 0 on; groups of a single hold have none.
        part: (n, S) where in ``margins`` a hold's margins in a station are, -1 if it is not in it.
        margins: (P, T, L, A) margins (m), below 0 where infeasible.
        table: (n, n) which of the tables of gaps two holds a < b have, -1 if they never meet.
        row: (T, L, L) where in ``gaps`` a pair of lines is.
        gaps: (K, A) gaps (m) by the later hold's column less the earlier one's.
    """

    order: np.ndarray
    alone: Array
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
        left: (W,) scratch.
        reached: (n + 1,) by depth: what they reach.
        place: (n, 2) line and column of each hold.
    """

    sets: _Sets
    at: np.ndarray
    columns: np.ndarray
    allowed: np.ndarray
    turns: np.ndarray
    left: np.ndarray
    reached: Array
    place: np.ndarray


def explore(
    problem: Problem, floor: float, ceiling: float, improve: bool, cells: np.ndarray
) -> tuple[int, float]:
    """Find placements whose score is above a floor and below a ceiling.

    Args:
        problem: what is to be placed.
        floor: what the score must exceed.
        ceiling: what the score must stay below.
        improve: raise the floor to each score that is found, so that the last is the best.
        cells: (m, n, 2) receives lines and columns: the best, or the first m that are found.

    Returns:
        How many were found (at most m, or 1 where the best is sought), and the last one's score.
    """
    return _explore(problem, float(floor), float(ceiling), improve, cells, _new_memory(problem))


def _new_memory(problem: Problem) -> _Memory:
    """Return the memory of a search that has not begun."""
    holds, lines = problem.order.shape
    angles, stations = problem.gaps.shape[1], problem.part.shape[1]
    parts, torsos = problem.margins.shape[:2]
    words = (angles + WORD - 1) // WORD
    count, double = parts * torsos * lines, 2 * words + 1
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
        left=np.empty(words, np.uint64),
        reached=np.full(holds + 1, np.inf),
        place=np.zeros((holds, 2), np.int64),
    )
    # Turning all of them changes nothing, so the first has column 0.
    memory.allowed[0, 0] = np.arange(words) == 0
    memory.allowed[0, 1:] = all_columns
    memory.turns[0] = all_columns
    return memory


@njit(**ENTRY)
def _explore(problem, floor, ceiling, improve, cells, memory):
    """Do what `explore` does, in memory that `_new_memory` returned."""
    holds, lines = problem.order.shape
    sets, at, columns, allowed, turns, left, reached, place = memory
    made = 0
    count, score, depth = 0, floor, 0
    while depth >= 0:
        column = _take_first(columns[depth])
        if column < 0:
            at[depth] += 1
            line = problem.order[depth, min(at[depth], lines - 1)]
            if at[depth] == lines or min(problem.alone[depth, line], reached[depth]) <= floor:
                at[depth] = -1  # the lines that follow are no better
                depth -= 1
            else:
                _copy(allowed[depth, depth, line], columns[depth])
            continue
        line = problem.order[depth, at[depth]]
        place[depth, 0], place[depth, 1] = line, column
        here = min(reached[depth], problem.alone[depth, line], _gap(problem, place, depth))
        if here <= floor or not _turn(problem, sets, made, floor, place, depth, turns, left):
            continue
        if depth < holds - 1:
            reached[depth + 1] = here
            if _narrow(problem, sets, made, floor, place, depth, allowed):
                depth += 1
            continue
        here = min(here, _together(problem, place, turns[holds], left))
        if not floor < here < ceiling:
            continue
        score = here
        for d in range(holds):
            cells[count, d, 0], cells[count, d, 1] = place[d, 0], place[d, 1]
        if improve:
            floor = here
            made += 1
            for d in range(holds):  # above the new floor fewer turns are left
                _turn(problem, sets, made, floor, place, d, turns, left)
        else:
            count += 1
            if count == len(cells):
                break
    return max(count, min(made, 1)), score


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
                _copy(turns[depth, s, t], turns[depth + 1, s, t])
            continue
        any_left = False
        for t in range(torsos):
            i = (part * torsos + t) * lines + line
            if sets.margins_made[i] != made:
                _fill(sets.margins[i], problem.margins[part, t, line], floor)
                sets.margins_made[i] = made
            any_left |= _meet(turns[depth, s, t], sets.margins[i], column, turns[depth + 1, s, t])
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
                _copy(before, after)
                any_left = True
                continue
            i = problem.row[table, place[depth, 0], line]
            if sets.gaps_made[i] != made:
                _fill(sets.gaps[i], problem.gaps[i], floor)
                sets.gaps_made[i] = made
            any_left |= _meet(before, sets.gaps[i], (angles - place[depth, 1]) % angles, after)
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
        turn = _take_first(left)
        while turn >= 0:
            margin = np.inf
            for other in range(s, len(problem.group)):
                if problem.group[other] == problem.group[s]:
                    margin = min(margin, _station_margin(problem, place, other, turn))
            best = max(best, margin)
            turn = _take_first(left)
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


@njit(**STRICT)
def _copy(bits, out):
    """Copy a set."""
    for w in range(len(bits)):
        out[w] = bits[w]


@njit(**STRICT)
def _fill(bits, values, floor):
    """Write the set of columns whose value is above the floor, twice in a row."""
    for w in range(len(bits)):
        bits[w] = 0
    angles = len(values)
    for j in range(angles):
        if values[j] > floor:
            for k in (j, j + angles):
                bits[k // WORD] |= np.uint64(1) << np.uint64(k % WORD)


@njit(**STRICT)
def _meet(own, other, first, both):
    """Write what a set shares with another one read from column ``first``; tell whether it is anything."""
    i, shift = first // WORD, np.uint64(first % WORD)
    anything = False
    for w in range(len(own)):
        bits = other[i + w] >> shift
        if shift:
            bits |= other[i + w + 1] << (np.uint64(WORD) - shift)
        both[w] = own[w] & bits
        anything |= both[w] != 0
    return anything


@njit(**STRICT)
def _take_first(bits):
    """Take the first column out of a set and return it, or -1 if the set is empty."""
    for w in range(len(bits)):
        if bits[w]:
            low = bits[w] & (~bits[w] + np.uint64(1))
            bits[w] ^= low
            place = 0
            for step in (32, 16, 8, 4, 2, 1):
                if low >> np.uint64(step):
                    low >>= np.uint64(step)
                    place += step
            return WORD * w + place
    return -1
