"""Grids are compared cell by cell, and a plan that a grid loses is said to be lost."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from symgrasp.bench.maps.grids import Counts, GridResult, coarsest, compare, measure_grids
from symgrasp.cli.main import main
from symgrasp.errors import Cancelled
from symgrasp.feasibility.create import create_map
from symgrasp.planners.planning import plan_sequential
from symgrasp.world import prepared
from tests.conftest import load_small, write_scene


@given(st.data(), st.integers(1, 4), st.integers(1, 5), st.integers(1, 3), st.integers(1, 3))
def test_counts_are_those_of_a_loop_over_all_cells(data, heights, angles, k, m):
    coarse = data.draw(arrays(bool, (2, heights, angles)))
    fine = data.draw(arrays(bool, (2, k * heights, m * angles)))
    missed = overstated = 0
    mixed = set()
    for roll, row, column in np.ndindex(*fine.shape):
        cell = roll, row // k, column // m
        missed += fine[roll, row, column] and not coarse[cell]
        if coarse[cell] and not fine[roll, row, column]:
            overstated += 1
            mixed.add(cell)
    expected = Counts(
        fine.size, fine.sum(), coarse.sum() * k * m, missed, overstated, coarse.sum(), len(mixed)
    )
    assert compare(coarse, fine) == expected


def test_a_grid_compared_with_itself_has_no_error():
    scene = prepared(load_small("bottle_on_table"))
    (result,) = measure_grids(scene, [(8, 16)], (8, 16))
    the_map = create_map(scene)
    assert result.counts.truly == result.counts.called == the_map.feasible.sum() > 0
    assert result.error == 0
    assert result.no_plan is None
    (task,) = plan_sequential(scene).tasks
    (hold,) = task.holds
    assert (result.margin_along, result.margin_around) == (hold.margin_along, hold.margin_around)
    assert result.clearance == hold.clearance


def test_maps_of_all_tasks_and_arms_count_together():
    scene = prepared(load_small("handover_between_robots"))
    (result,) = measure_grids(scene, [(4, 8)], (8, 16))
    keys = [(task.name, arm) for task in scene.tasks.values() for arm in task.arms]
    fine = [create_map(scene, task=task, arm=arm).feasible for task, arm in keys]
    assert result.counts.truly == sum(m.sum() for m in fine)
    assert result.counts.cells == len(keys) * 2 * 8 * 16


def test_a_plan_that_a_grid_loses_is_said_to_be_lost():
    """The middle of the only cell along the log is where both hands meet."""
    scene = prepared(load_small("log_iiwa_and_panda"))
    lost, kept = measure_grids(scene, [(1, 8), (16, 16)], (16, 16))
    assert lost.no_plan
    assert lost.margin_along is None
    assert lost.line().endswith("none")
    assert kept.no_plan is None
    assert "mm" in kept.line()


def test_the_coarsest_grid_is_good_enough_like_all_finer_ones():
    counts = Counts(cells=1000, truly=100, called=100, coarse=10)
    results = [GridResult(n, n, replace(counts, missed=missed)) for n, missed in enumerate([9, 30, 8, 2, 1])]
    assert coarsest(results, 0.1) == results[2]
    assert coarsest(results, 0.02) == results[3]
    assert coarsest(results, 0.005) is None


def test_progress_grows_and_can_cancel():
    scene, shares = prepared(load_small("bottle_on_table")), []
    list(measure_grids(scene, [(4, 8), (8, 16)], (8, 16), shares.append))
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)

    def cancel(share: float) -> None:
        if share > 0.5:
            raise Cancelled

    with pytest.raises(Cancelled):
        list(measure_grids(scene, [(4, 8), (8, 16)], (8, 16), cancel))


@pytest.mark.parametrize("ending", ["json", "png", "svg"])
def test_the_command_prints_and_writes(content, tmp_path, capsys, ending):
    content["map"] = {"redundancy": 1}
    out = tmp_path / f"grid.{ending}"
    assert main(["grid", str(write_scene(tmp_path, content)), "--error", "60", "--out", str(out)]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert "compared with those on 192 × 384" in printed[0]
    assert printed[1].split()[:2] == ["grid", "feasible"]
    assert "coarsest grid with an error of at most 60 %" in printed[-2]
    if ending == "json":
        written = json.loads(out.read_text())
        assert [(g["heights"], g["angles"]) for g in written["grids"]][-1] == (96, 192)
    else:
        assert out.stat().st_size > 10_000


def test_bad_options_are_refused_in_one_line(capsys):
    with pytest.raises(SystemExit):
        main(["grid", "bottle_on_table", "--error", "0"])
    assert "'0': expected a number between 0 and 100" in capsys.readouterr().err
    assert main(["grid", "bottle_on_table", "--out", "grid.csv"]) == 2
    assert "'grid.csv': expected an ending" in capsys.readouterr().err
