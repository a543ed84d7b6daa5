"""All plans there are, in order, none of them twice; and what a page shows of plans."""

from __future__ import annotations

from contextlib import closing
from itertools import islice, pairwise, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.cli.main import main
from symgrasp.errors import Cancelled, PlanError
from symgrasp.feasibility.cell import Cell
from symgrasp.feasibility.create import create_map
from symgrasp.object.manifold import ROLLS
from symgrasp.plan.checked_plan import check_plan
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.planners.bimanual import ClimbStep
from symgrasp.planners.free import FreePlacements
from symgrasp.planners.planning import (
    bimanual_plans,
    handover_plans,
    plan_bimanual,
    sequential_maps,
    sequential_plans,
)
from symgrasp.planners.sequential import common_grasps
from tests.conftest import load_small
from tests.plan.test_plan import bimanual, handover, sequential
from tests.planners.small_maps import Picky, apart, random_maps, score, together


def near(a, b) -> bool:
    """Whether no hand is more than a neighbouring cell away, whatever both are turned by."""
    first = [(c.column - cells[0].column) % 8 for cells in (a, b) for c in cells]
    columns = zip(first[: len(a)], first[len(a) :], strict=True)
    return all(
        x.roll == y.roll and abs(x.row - y.row) <= 1 and min((i - j) % 8, (j - i) % 8) <= 1
        for x, y, (i, j) in zip(a, b, columns, strict=True)
    )


@given(st.integers(0, 2**32 - 1), st.sampled_from([0.05, 0.2]))
@settings(max_examples=30, deadline=None)
def test_every_free_placement_is_listed_or_next_to_a_better_one(seed, density):
    """Against all pairs of cells: falling scores, no neighbours, nothing left out."""
    maps = random_maps(seed, 2, density)
    finder = Picky(maps, seed)
    listed = list(FreePlacements(together(maps), [finder]))
    assert [p.score for p in listed] == sorted((p.score for p in listed), reverse=True)
    for k, placement in enumerate(listed):
        assert finder.find(placement.steps[0].cells)
        assert not any(near(placement.grasps, other.grasps) for other in listed[:k])
    for cells in product(*([Cell(*map(int, c)) for c in np.argwhere(m.feasible)] for m in maps)):
        if apart(cells) >= 0 and finder.find(cells):
            reached = score(cells, maps)
            assert any(p.score >= reached - 1e-12 and near(p.grasps, cells) for p in listed)


def test_a_plan_for_every_height_and_roll_that_serves_the_sequence():
    """As many as the plain list of heights and rolls, in its order, with the angles that it allows."""
    scene = load_small("pick_pour_place", 12, 24, 8)
    maps = sequential_maps(scene)
    grasps = common_grasps(list(maps.values()))
    plans = list(sequential_plans(scene, maps=maps))
    assert plans[0] == sequential()
    assert len(plans) == len(grasps) > 3
    for plan, grasp in zip(plans, grasps, strict=True):
        holds = [task.holds[0] for task in plan.tasks]
        radius = float(scene.profile.radius(holds[0].grasp.h))
        assert scene.manifold.cell(holds[0].grasp.h, 0.0)[0] == grasp.row
        assert holds[0].grasp.roll == ROLLS[grasp.roll]
        margin = min(min(h.margin_along, h.margin_around * radius) for h in holds)
        assert margin >= grasp.margin  # of which only a part counts near a limit
        for task, runs in zip(plan.tasks, grasp.intervals, strict=True):
            theta = task.holds[0].grasp.theta + task.delta  # where on the map of the pose as given
            _, column = scene.manifold.cell(holds[0].grasp.h, theta)
            assert any((column - first) % 24 < count for first, count in runs)
    assert verify(plans[-1]).failures == []


@pytest.mark.parametrize(
    ("plans", "best"),
    [
        (lambda: bimanual_plans(load_small("log_two_robots", 20, 24, 6)), bimanual),
        (lambda: handover_plans(load_small("handover_between_robots", 12, 24, 8)), handover),
    ],
)
def test_the_next_best_of_several_hands_hold_too(plans, best):
    with closing(plans()) as listed:
        first, *others = islice(listed, 4)
    assert first == best()
    assert len(others) == 3
    assert verify(others[-1]).failures == []
    grasps = [tuple(hold.grasp for task in p.tasks for hold in task.holds) for p in (first, *others)]
    assert len(set(grasps)) == 4


def test_on_the_command_line(tmp_path, capsys):
    """The list is numbered, and a number of it can be written."""
    out = tmp_path / "plan.json"
    assert (
        main(["plan", "sequential", "pick_pour_place", "--list", "3", "--number", "2", "--out", str(out)])
        == 0
    )
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[0:6:2]] == ["1", "2", "3"]
    assert "pick" in lines[1]
    assert "° to " in lines[1]
    grasp = Plan.load(out).tasks[0].holds[0].grasp
    assert f"h = {100 * grasp.h:.1f} cm" in lines[2]
    assert main(["plan", "bimanual", "log_two_robots", "--list", "2"]) == 0
    first, second = capsys.readouterr().out.splitlines()
    assert first.split()[1:] != second.split()[1:]
    assert main(["plan", "sequential", "soda_can"]) == 2
    assert "--list" in capsys.readouterr().err
    assert main(["plan", "sequential", "soda_can", "--list", "2", "--method", "first"]) == 2
    assert "one plan only" in capsys.readouterr().err
    assert main(["plan", "sequential", "soda_can", "--number", "9999", "--out", str(out)]) == 2
    assert "there are no more plans" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["plan", "sequential", "soda_can", "--list", "0"])


def moves(a: ClimbStep, b: ClimbStep, angles: int) -> int:
    """By how many cells the hands moved together."""
    return sum(
        abs(x.row - y.row) + min((x.column - y.column) % angles, (y.column - x.column) % angles)
        for x, y in zip(a.cells, b.cells, strict=True)
    )


def test_a_climb_can_be_replayed():
    """Every iteration of every restart: one hand moves by one cell at most, the last has no collisions."""
    scene = load_small("log_two_robots", 20, 24, 6)
    task = scene.task()
    maps = {(task.name, arm): create_map(scene, arm=arm) for arm in task.arms}
    for seed in range(100):
        trace: list[ClimbStep] = []
        plan = plan_bimanual(scene, maps=maps, method="hill_climb", seed=seed, trace=trace)
        if len(trace) > 3:  # it began where the hands overlap
            break
    else:
        pytest.fail("it never climbed")
    statistics = plan.planner.statistics
    assert trace[-1].collisions == 0
    assert sum(step.collisions == 0 for step in trace) == statistics["body_checks"]
    assert trace[-1].restart + 1 == statistics["restarts"]
    assert sum(step.collisions > 0 for step in trace) == statistics["iterations"]
    for before, after in pairwise(trace):
        assert after.restart in (before.restart, before.restart + 1)
        if after.restart == before.restart:
            assert moves(before, after, 24) <= 1
    grid = scene.manifold
    held = [grid.cell(hold.grasp.h, hold.grasp.theta) for hold in plan.tasks[0].holds]
    assert held == [(cell.row, cell.column) for cell in trace[-1].cells]


def test_a_plan_from_a_file_is_verified_before_it_is_shown():
    shares: list[float] = []
    content = sequential().to_json()
    checked = check_plan(content.encode(), "plan.json", shares.append)
    assert checked.report.holds
    assert checked.plan == sequential()
    assert checked.scene is not None
    assert list(checked.scene.arms) == ["panda"]
    assert checked.scene.sha256 == load_small("pick_pour_place", 12, 24, 8).sha256
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert len(shares) > 20
    broken = check_plan(content.replace('"delta": 0.0', '"delta": 0.1'), "plan.json")
    assert not broken.report.holds
    assert broken.scene is None
    with pytest.raises(PlanError, match=r"plan.json: file"):
        check_plan(b"\xff", "plan.json")


def test_verifying_can_be_cancelled():
    def stop(share: float) -> None:
        if share > 0.6:  # amid the margins
            raise Cancelled

    with pytest.raises(Cancelled):
        check_plan(sequential().to_json(), "plan.json", stop)
