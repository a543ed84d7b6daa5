"""Every shipped scene, as it ships: its planner finds a plan, and the plan holds."""

from __future__ import annotations

import pytest

from symgrasp.cli.main import main
from symgrasp.errors import SceneError
from symgrasp.plan.plan import Plan
from symgrasp.plan.verify import verify
from symgrasp.planners.planning import plan_bimanual, plan_handover, plan_sequential
from symgrasp.scene.scene import Scene
from tests.conftest import PLAIN, SHIPPED


def plan_for(scene: Scene) -> Plan:
    """Plan with the planner that the scene is made for."""
    if all(len(task.arms) == 1 for task in scene.tasks.values()):
        return plan_sequential(scene)
    return plan_bimanual(scene) if len(scene.tasks) == 1 else plan_handover(scene)


@pytest.mark.parametrize("name", SHIPPED)
def test_the_scene_s_planner_finds_a_plan_that_holds(name):
    scene = Scene.load(name)
    plan = plan_for(scene)
    assert verify(plan, scene=scene, strict=True).failures == []
    grid = scene.manifold
    cells = {grid.cell(h.grasp.h, h.grasp.theta) for task in plan.tasks for h in task.holds}
    assert cells != {(0, 0)}
    assert all(hold.margin_along > 0 for task in plan.tasks for hold in task.holds)


def test_a_scene_whose_robots_are_not_installed_is_refused(monkeypatch, capsys):
    """One line says what to install; the list of scenes says it too."""
    monkeypatch.setattr("symgrasp.scene.shipped.package_dirs", lambda reference: [])
    with pytest.raises(SceneError, match=r"pip install 'symgrasp\[robots\]'") as refused:
        Scene.load("log_two_humanoids")
    assert "\n" not in str(refused.value)
    assert main(["scenes"]) == 0
    lines = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert {name for name, line in lines.items() if "symgrasp[robots]" in line} == set(SHIPPED) - set(PLAIN)
