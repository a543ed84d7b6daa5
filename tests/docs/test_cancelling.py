"""How long computations go on after a cancel is measured of everything that the page computes."""

from __future__ import annotations

import time

import numba
import pytest

from docs import cancelling
from docs.cancelling import Meter, gaps_of, reading
from symgrasp.compiling import notify_on_compile
from symgrasp.errors import Cancelled
from tests.conftest import load_small

MAPS = ("the map", "the candidates of a cell", "the map compared", "probabilities", "windows")
HANDS = ("bimanual exact lift", "bimanual exact lift, motion", "bimanual hill_climb lift")
REST = ("survey of the object", "survey of the robot", "the scene, uploaded", "another robot")
SEQUENCES = ("sequential best panda", "sequential first panda", "sequential regrasp panda")
WORKS = {"log_two_robots": {*MAPS, *HANDS, *REST}, "soda_can": {*MAPS, *SEQUENCES, *REST}}


def test_the_longest_time_between_two_calls_is_kept_and_compiling_apart():
    meter = Meter()
    for pause in (0.01, 0.05, 0.01):
        time.sleep(pause)
        meter(0.5)
    assert 0.05 <= meter.clock < meter.total
    assert meter.cpu < meter.clock
    with notify_on_compile(meter.compiling):
        numba.njit(lambda x: x + 1)(1)
    meter.lap()
    assert meter.compiled > 0
    assert meter.clock < meter.compiled + 0.05


def test_what_takes_too_long_is_cancelled():
    with pytest.raises(Cancelled):
        Meter(longest=0.0)(0.5)


@pytest.mark.parametrize("name", WORKS)
def test_everything_that_the_page_computes_is_measured(name, monkeypatch):
    monkeypatch.setattr(cancelling, "LONGEST", 5.0)  # planners need less, also on a busy machine
    gaps = list(gaps_of(name, first=False))
    assert WORKS[name] <= {gap.work for gap in gaps}
    assert all(gap.clock > 0 or gap.compiled > 0 for gap in gaps)
    assert all(gap.clock <= gap.total for gap in gaps)


def test_a_plan_is_opened_with_its_motion_too():
    works = []
    for work in cancelling._plans(load_small("soda_can")):
        work.run(lambda _: None)
        works.append(work)
    opened = {"sequential best panda, opened", "sequential best panda, opened with its motion"}
    assert opened <= {work.name for work in works}
    assert all(work.reads for work in works if work.name in opened)


def test_the_upload_of_a_large_mesh_is_given_up():
    gap = reading()
    assert "20 MB" in gap.work or "19 MB" in gap.work
    assert gap.clock > 0
