"""What tells the colours of the page apart without colour, and to the colour-blind."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pytest

import app.shell.files
from app.render.palette import PRINTS
from app.render.patterns import PLAIN, cell_patterns
from symgrasp.feasibility.color_by import FEASIBLE, INFEASIBLE, NONE, ColorBy
from symgrasp.reason import Reason
from tests.feasibility.test_color_by import SEEN, lab

DRAWN = (Path(app.shell.files.__file__).parent / "static/patterns.js").read_text(encoding="utf-8")


def test_every_reason_has_a_pattern_of_its_own_that_the_page_draws():
    patterns = cell_patterns(ColorBy.REASON)
    assert len(set(patterns)) == len(Reason)
    assert patterns[Reason.FEASIBLE] == PLAIN
    lines = dict(re.findall(r"^  (\w+): \"(M[^\"]+)\"", DRAWN, re.MULTILINE))
    assert {name for name in patterns if name} == set(lines)
    assert len(set(lines.values())) == len(lines)


@pytest.mark.parametrize("color_by", [c for c in ColorBy if c is not ColorBy.REASON])
def test_what_is_not_feasible_has_one_where_colours_show_a_value(color_by):
    not_feasible, *others = cell_patterns(color_by)
    assert not_feasible != PLAIN
    assert set(others) == {PLAIN}


@pytest.mark.parametrize("eyes", SEEN)
def test_the_colour_blind_can_tell_hands_and_places_apart(eyes):
    """Hands and their overlap; places of a survey that have a plan, none, or are not known."""
    for colors, least in ((PRINTS[1:], 18), (np.array([FEASIBLE, INFEASIBLE, NONE]), 18)):
        seen = lab(colors, eyes)
        for a, b in itertools.combinations(range(len(seen)), 2):
            assert np.linalg.norm(seen[a] - seen[b]) > least, (a, b)
