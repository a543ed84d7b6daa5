"""Archives of robots as people upload them."""

from __future__ import annotations

import re
from pathlib import Path

import pybullet_data

from app.files.archives import pack

PANDA = Path(pybullet_data.getDataPath()) / "franka_panda"


def panda_archive() -> bytes:
    """Return the Panda as a ROS package, with its meshes as ``package://my_panda/…``."""
    urdf = (PANDA / "panda.urdf").read_text(encoding="utf-8")
    urdf = re.sub(r'filename="(?:package://)?(?:\./)?meshes', 'filename="package://my_panda/meshes', urdf)
    meshes = sorted(path for path in (PANDA / "meshes").rglob("*") if path.is_file())
    files = [(f"my_panda/{path.relative_to(PANDA).as_posix()}", path.read_bytes()) for path in meshes]
    return pack([("my_panda/urdf/panda.urdf", urdf.encode()), *files])
