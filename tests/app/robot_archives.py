"""Archives of robots as people upload them."""

from __future__ import annotations

import re
from pathlib import Path

import pybullet_data

from app.compute.upload_service import UploadService
from app.files.archives import pack
from symgrasp.files import SCENES_DIR
from symgrasp.plan.plan import Plan
from symgrasp.planners.planning import plan_sequential
from symgrasp.scene.scene import Scene

PANDA = Path(pybullet_data.getDataPath()) / "franka_panda"


def panda_archive() -> bytes:
    """Return the Panda as a ROS package, with its meshes as ``package://my_panda/…``."""
    urdf = (PANDA / "panda.urdf").read_text(encoding="utf-8")
    urdf = re.sub(r'filename="(?:package://)?(?:\./)?meshes', 'filename="package://my_panda/meshes', urdf)
    meshes = sorted(path for path in (PANDA / "meshes").rglob("*") if path.is_file())
    files = [(f"my_panda/{path.relative_to(PANDA).as_posix()}", path.read_bytes()) for path in meshes]
    return pack([("my_panda/urdf/panda.urdf", urdf.encode()), *files])


def plan_of_upload(folder: Path) -> Plan:
    """Return a plan of that Panda, uploaded into an empty folder."""
    bottle = Scene.load("bottle_on_table").with_settings(heights=8, angles=16, redundancy=8)
    service = UploadService((SCENES_DIR,))
    _, built = service.read_robot(
        bottle, "panda", "p.zip", panda_archive(), folder, bottle, lambda share: None
    )
    return plan_sequential(built.scene)
