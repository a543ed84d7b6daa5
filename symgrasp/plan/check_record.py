"""What a plan says of its planner, and of the scene that it is for."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from typing import Any

from symgrasp.errors import SymgraspError, as_written
from symgrasp.plan.algorithms import ALGORITHMS
from symgrasp.plan.plan import Plan
from symgrasp.plan.report import Report
from symgrasp.scene.scene import Scene

__all__ = ["check_planner", "check_scene"]

MOST_DIFFERENCES = 20
"""Most differences between two scenes that are named."""

MISSING = "nothing"
"""What stands for a value that one of two scenes lacks."""


def check_planner(plan: Plan, report: Report) -> None:
    """Check that the planner is one that makes plans of this kind."""
    planner, known = plan.planner, ALGORITHMS[plan.kind]
    text = f"planner: {planner.algorithm} makes no {plan.kind} plans, which are made by {', '.join(known)}"
    report.expect(planner.algorithm in known, text)
    by_chance = planner.algorithm == "hill_climb"
    report.expect((planner.seed is not None) == by_chance, f"planner: seed is {planner.seed}")
    report.expect(bool(planner.settings) == by_chance, f"planner: settings are {planner.settings}")


def check_scene(plan: Plan, pinned: Scene | None, report: Report) -> Scene | None:
    """Check the scene of a plan, its hash, and that it is the one that it must be for.

    Args:
        plan: the plan.
        pinned: the scene that the plan must be for; any if None.
        report: where what is found is noted.

    Returns:
        The scene, built from the plan's content; None where that is no scene.
    """
    record = plan.scene
    canonical = json.dumps(record.content, sort_keys=True).encode()
    digest = hashlib.sha256(canonical).hexdigest()
    report.expect(digest == record.sha256, f"scene: sha256 is {digest}, not {record.sha256}")
    try:
        scene = Scene.from_content(record.content, "plan: scene.content")
    except SymgraspError as error:
        report.expect(False, f"scene: {error}")
        return None
    report.expect(
        record.name == scene.name, f"scene: name is {as_written(scene.name)}, not {as_written(record.name)}"
    )
    for path, here, there in _differences(record.content, scene.content, ""):
        if here not in (as_written(None), MISSING):  # keys that later versions added
            report.expect(False, f"scene: {path} is {here}, but read as {there}")
    if pinned is not None:
        found = list(_differences(scene.content, pinned.content, ""))
        for path, here, there in found[:MOST_DIFFERENCES]:
            report.expect(False, f"scene: {path} is {here}, but {there} in {pinned.source}")
        more = len(found) - MOST_DIFFERENCES
        report.expect(more <= 0, f"scene: {more} more differences from {pinned.source}")
    for name, robot in scene.robots.items():
        joints = plan.robots.get(name)
        report.expect(
            joints == robot.model.joint_names,
            f"robots: {name} has joints {as_written(robot.model.joint_names)}",
        )
    report.expect(
        set(plan.robots) == set(scene.robots), f"robots: the scene has {as_written(sorted(scene.robots))}"
    )
    return scene


def _differences(a: Any, b: Any, path: str) -> Iterator[tuple[str, str, str]]:
    """Yield (path, value in a, value in b) for all values in which plain data differs."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in [*a, *(key for key in b if key not in a)]:
            below = f"{path}.{key}".lstrip(".")
            if key in a and key in b:
                yield from _differences(a[key], b[key], below)
            else:
                yield below, _shown_at(a, key), _shown_at(b, key)
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for k, (x, y) in enumerate(zip(a, b, strict=True)):
            yield from _differences(x, y, f"{path}[{k}]")
    elif a != b or isinstance(a, bool) != isinstance(b, bool):
        yield path, _shown(a), _shown(b)


def _shown_at(mapping: Mapping[str, Any], key: str) -> str:
    return _shown(mapping[key]) if key in mapping else MISSING


def _shown(value: object) -> str:
    """Return a value as a line shows it: many values by their number."""
    return f"{len(value)} values" if isinstance(value, list | dict) else as_written(value)
