"""The benchmark measures what it says; no figure here depends on how fast the machine is."""

from __future__ import annotations

import json

import numpy as np
import pytest

from symgrasp import bench
from symgrasp.bench import planners
from symgrasp.bench.maps import map_times
from symgrasp.bench.maps.brute import BruteForce
from symgrasp.cli.main import main
from symgrasp.feasibility.create import MapMaker
from symgrasp.ik import solver_for
from symgrasp.poses import inverse
from symgrasp.reason import Reason
from symgrasp.world import BulletWorld
from tests.conftest import PLAIN, load_small


def figures(found) -> dict[str, bench.Figure]:
    return {figure.name.strip(): figure for figure in found}


def test_two_hands_exact_never_misses_what_climbing_finds():
    found = figures(planners.several_hands(pairs=3))
    (exact,) = found["two hands, complete search: success in 6 pairs"].values
    (climb,) = found["two hands, hill climbing as printed: success in 6 pairs"].values
    assert exact >= climb > 0
    assert len(found["two hands, complete search with whole robots"].values) == 6
    assert min(found["smallest of gap and margins, more than climbing reaches"].values) >= -1e-9


def test_on_the_command_line(monkeypatch, tmp_path, capsys):
    made = [bench.Figure("a", "ms", (1.0, 2.0, 4.0)), bench.Figure("b", "×", (3.0,))]
    monkeypatch.setattr(bench, "run", lambda: iter(made))
    assert main(["bench", "--out", str(tmp_path / "bench.json")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "2 ms" in lines[0]
    assert "(1 to 4)" in lines[0]
    content = json.loads((tmp_path / "bench.json").read_text())
    assert content["figures"][1] == {"name": "b", "unit": "×", "values": [3.0]}
    assert content["machine"]["cpus"] >= 1


def test_a_long_sequence_and_sampling_are_measured():
    (sequence,) = planners.long_sequence(tasks=6, runs=2)
    assert len(sequence.values) == 2
    success, *ratios = planners.without_the_manifold(runs=2)
    assert set(success.values) <= {0.0, 1.0}
    assert [len(ratio.values) for ratio in ratios] == [2, 2]


def test_maps_are_measured_against_the_slow_ways(monkeypatch):
    monkeypatch.setattr(map_times, "GRID", {"heights": 6, "angles": 8, "redundancy": 4})
    monkeypatch.setattr(map_times, "SECONDS", dict.fromkeys(map_times.SECONDS, 0.01))
    found = figures(map_times.against_others(["soda_can", "log_two_robots"], rounds=2))
    assert len(found["map of soda_can"].values) == 2 * 2 * 3
    for other in map_times.SECONDS:
        (total,) = [f for name, f in found.items() if name == f"maps of all shipped scenes: {other} takes"]
        assert len(total.values) == 2
        assert min(total.values) > 0


def test_every_arm_of_a_scene_and_the_approach(monkeypatch):
    monkeypatch.setattr(map_times, "GRID", {"heights": 6, "angles": 8, "redundancy": 4})
    found = list(map_times.every_arm(["soda_can", "log_iiwa_and_panda"], rounds=2))
    assert [len(f.values) for f in found] == [2, 2, 2, 2]
    assert [len(f.cpu) for f in found] == [2, 2, 2, 0]
    assert sorted(found[-1].values)[0] == 1.0
    assert {f.name for f in found[1:3]} == {
        f"every arm: log_iiwa_and_panda, {arm}" for arm in ("panda", "iiwa")
    }
    assert [len(f.values) for f in map_times.approach(1)] == [1, 1]


def test_four_hands_are_measured():
    (figure,) = planners.four_hands(windows=1)
    assert len(figure.values) == len(figure.cpu) == 1


def test_without_coal_the_bench_says_how_to_get_it(monkeypatch):
    monkeypatch.setattr(map_times, "GRID", {"heights": 4, "angles": 4, "redundancy": 2})
    monkeypatch.setattr(map_times, "SECONDS", dict.fromkeys(map_times.SECONDS, 0.01))
    monkeypatch.setattr(map_times, "has_coal", lambda: False)
    last = list(map_times.against_others(["soda_can"], rounds=1))[-1]
    assert "pip install" in last.line()
    assert last.values == ()


def test_growth_boxes_and_turning(monkeypatch):
    monkeypatch.setattr(map_times, "GRID", {"heights": 4, "angles": 8, "redundancy": 2})
    monkeypatch.setattr(map_times, "FINE", 48)
    assert [len(figure.values) for figure in map_times.boxes(rounds=2)] == [2, 2]
    assert len(next(iter(map_times.turning(3))).values) == 3
    assert [len(figure.values) for figure in map_times.growth(1)] == [1, 1]


@pytest.mark.parametrize("name", PLAIN)
def test_brute_force_agrees_with_the_map(name):
    """Coal finds the same cells feasible as PyBullet: only its rounding of links beside meshes differs."""
    scene = load_small(name)
    task = scene.task()
    arm = scene.arm(task.arms[0])
    with BulletWorld(scene) as world:
        m = MapMaker(world).map()
        brute = BruteForce(world, arm, solver_for(arm, scene.settings.samples), task.T_world_object)
        tools = m.manifold.tool_poses(task.T_world_object, arm.hand.finger_depth)
        T = inverse(arm.robot.T_world_base) @ tools
        live = np.argwhere(m.reason >= Reason.UNREACHABLE)
        same = [brute.feasible(T[tuple(c)], float(m.opening[c[1]])) == m.feasible[tuple(c)] for c in live]
    assert brute.pairs > 50
    meshes = any(o.kind == "mesh" for o in scene.obstacles)
    assert np.mean(same) >= (0.97 if meshes else 0.998)
