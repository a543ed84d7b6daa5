"""Reading a plan file and verifying it before anything of it is shown."""

from __future__ import annotations

from dataclasses import dataclass

from symgrasp.plan.plan import Plan
from symgrasp.plan.report import Report
from symgrasp.plan.verify import verify
from symgrasp.progress import Progress
from symgrasp.scene.scene import Scene

__all__ = ["CheckedPlan", "check_plan"]


@dataclass(frozen=True, eq=False)
class CheckedPlan:
    """A plan that came from a file.

    Attributes:
        plan: the plan.
        report: what was checked, and what does not hold.
        scene: the plan's own scene; None where the plan does not hold.
    """

    plan: Plan
    report: Report
    scene: Scene | None


def check_plan(content: str | bytes, source: str, progress: Progress | None = None) -> CheckedPlan:
    """Read a plan and verify it, before anything of it is shown.

    Args:
        content: of the file.
        source: its name, for errors.
        progress: called with the finished share; may raise `Cancelled`.

    Raises:
        PlanError: the content is not a plan.
    """
    plan = Plan.parse(content, source)
    report = verify(plan, progress)
    scene = Scene.from_content(plan.scene.content, source) if report.holds else None
    return CheckedPlan(plan, report, scene)
