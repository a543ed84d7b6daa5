"""Archives of a plan with the files of uploaded robots that its scene refers to."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Sequence
from pathlib import Path

from symgrasp.errors import PlanError
from symgrasp.files import read_file
from symgrasp.plan.plan import LARGEST_PLAN, Plan
from symgrasp.scene.content import content_sha256

from .archives import pack, unpack
from .scene_files import (
    names_beside,
    only_file,
    refer_beside,
    refuse_foreign_files,
    unpacked_robots,
    upload_files,
)

__all__ = ["plan_archive", "read_plan_archive"]


def plan_archive(plan: Plan, name: str, folders: Sequence[Path]) -> bytes:
    """Return a ZIP file with a plan and the uploaded robots that its scene refers to.

    Args:
        plan: the plan.
        name: of the plan file in it.
        folders: where the files of uploaded robots are.
    """
    beside = names_beside(folders)
    content = copy.deepcopy(plan.scene.content)
    refer_beside(content, beside)
    plan = plan.model_copy(update={"scene": plan.scene.with_content(content)})
    return pack([(name, plan.to_json().encode()), *upload_files(beside)])


def read_plan_archive(name: str, content: bytes, folder: Path, folders: Iterable[Path]) -> Plan:
    """Unpack an archive that `plan_archive` may have made, and return the plan in it.

    Args:
        name: of the archive.
        content: of the archive.
        folder: an empty one to unpack it into.
        folders: of the server's own scenes.

    Raises:
        InputError: see `app.files.archives.unpack`; or there is not exactly one plan in its first folder.
        PlanError: it is no plan.
        SceneError, UrdfError: its scene refers to files that an uploaded scene may not use.
    """
    path = only_file(name, unpack(name, content, folder), folder, (".json",), "plan")
    plan = Plan.parse(read_file(path, LARGEST_PLAN + 1), path.name)
    digest = content_sha256(plan.scene.content)
    if digest != plan.scene.sha256:  # else its paths are not to be changed, and are read as another scene's
        raise PlanError(path.name, "scene.sha256", plan.scene.sha256, f"{digest}, that of scene.content")
    inside = folder.resolve()
    plan = plan.found_from(path.parent)
    refuse_foreign_files(f"{path.name}: scene.content", plan.scene.content, (inside, *folders))
    changed = copy.deepcopy(plan.scene.content)
    unpacked_robots(name, changed, inside)
    return plan.model_copy(update={"scene": plan.scene.with_content(changed)})
