"""Robots in MJCF, read by MuJoCo's own parser and written as the tree of a URDF.

MuJoCo resolves classes, frames, units and orientations; what comes after is in ``MjModel``
(https://mujoco.readthedocs.io/en/stable/APIreference/APItypes.html#mjmodel). Its bodies become links of
the same names, its world the root, its sites empty links; values of joints are those of ``qpos``.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from symgrasp.descriptions.mjcf_files import complete_mjcf
from symgrasp.descriptions.srdf import Srdf
from symgrasp.errors import UrdfError
from symgrasp.poses import Array, from_position_quat, from_rotation, inverse, rotation_about, rpy, translation

__all__ = ["read_mjcf"]

VISIBLE = 3
"""Geoms of groups below this are drawn, as MuJoCo's viewer does."""

MESH_ENDINGS = (".obj", ".stl")
"""Of the meshes that both MuJoCo and this library read."""

ALONE = "the robot alone: floor and other things are obstacles of a scene"


def read_mjcf(path: Path, root: ET.Element, inside: Path | None = None) -> tuple[ET.Element, Srdf]:
    """Return a robot in MJCF as the tree of a URDF, and what else it says as an SRDF would.

    Bodies that ``exclude`` names, or that no ``contype`` and ``conaffinity`` let collide, are those that may
    touch; keyframes are states. Joints that an ``equality`` couples in proportion mimic.

    Args:
        path: the file.
        root: what it holds, which is changed.
        inside: the folder that alone may be read from; None for a file of the user's own.

    Raises:
        UrdfError: MuJoCo is not installed or cannot read the file; or this is no tree of hinges and slides
            with a fixed base, or a geom that collides has a shape that a URDF does not know.
    """
    if find_spec("mujoco") is None:
        raise UrdfError(path, "mjcf", "an MJCF file of MuJoCo", "pip install 'symgrasp[mjcf]', or a URDF")
    mujoco: Any = import_module("mujoco")
    xml = complete_mjcf(path, root, inside)
    try:
        model = mujoco.MjModel.from_xml_string(ET.tostring(xml, encoding="unicode"))
    except (ValueError, mujoco.FatalError) as error:
        raise UrdfError(path, "mjcf", " ".join(str(error).split()), "what MuJoCo can read") from error
    _check(path, model)
    conversion = _Conversion(path, model, {m.get("name", ""): m for m in xml.iterfind("asset/mesh")})
    return conversion.urdf(xml.get("model", path.stem)), conversion.srdf()


def _check(path: Path, model: Any) -> None:
    """Raise UrdfError where a robot is more than a tree of links."""
    if model.nflex:
        raise UrdfError(path, "mjcf", f"{model.nflex} deformable bodies", "rigid bodies")
    for k in np.flatnonzero(model.body_mocapid >= 0):
        raise UrdfError(path, f"body {model.body(k).name}", "a mocap body", ALONE)
    for k in np.flatnonzero(model.tendon_limited):
        expected = "joints that are limited each by itself"
        raise UrdfError(path, f"tendon {model.tendon(k).name}", "a limited tendon", expected)


class _Conversion:
    """Writes a model of MuJoCo as URDF and SRDF.

    Args:
        path: the file, for error messages.
        model: the model.
        meshes: name → element of its meshes, with absolute paths.
    """

    def __init__(self, path: Path, model: Any, meshes: dict[str, ET.Element]) -> None:
        self._path, self._model, self._meshes = path, model, meshes
        self._bodies = [self._name("body", k) for k in range(model.nbody)]
        self._joints = [self._name("joint", k) for k in range(model.njnt)]
        self._collides = (model.geom_contype | model.geom_conaffinity) != 0
        self._collides[np.concatenate([model.pair_geom1, model.pair_geom2])] = True

    def urdf(self, name: str) -> ET.Element:
        """Return the tree of a URDF."""
        m = self._model
        robot = ET.Element("robot", name=name)
        followed = self._followed()
        for body in range(m.nbody):
            link = ET.SubElement(robot, "link", name=self._bodies[body])
            if m.body_mass[body] > 0:
                inertial = ET.SubElement(link, "inertial")
                _add_origin(inertial, translation(m.body_ipos[body]))
                ET.SubElement(inertial, "mass", value=repr(float(m.body_mass[body])))
            for geom in np.flatnonzero(m.geom_bodyid == body).tolist():
                self._add_geom(link, geom)
            if body:
                self._add_joints(robot, body, followed)
        for site in range(m.nsite):
            if called := m.site(site).name:
                link = f"{called}_site" if called in self._bodies else called
                ET.SubElement(robot, "link", name=link)
                pose = from_position_quat(m.site_pos[site], m.site_quat[site])
                _add_joint(robot, f"{link}_fixed", "fixed", self._bodies[m.site_bodyid[site]], link, pose)
        return robot

    def srdf(self) -> Srdf:
        """Return the pairs of bodies that may touch, and the keyframes."""
        m = self._model
        pairs = {frozenset((self._bodies[s >> 16], self._bodies[s & 0xFFFF])) for s in m.exclude_signature}
        geoms = [np.flatnonzero((m.geom_bodyid == k) & self._collides) for k in range(m.nbody)]
        explicit = {
            frozenset((int(m.geom_bodyid[a]), int(m.geom_bodyid[b])))
            for a, b in zip(m.pair_geom1, m.pair_geom2, strict=True)
        }
        for a in range(m.nbody):
            for b in range(a):
                types, affinities = m.geom_contype, m.geom_conaffinity
                meet = (types[geoms[a], None] & affinities[None, geoms[b]]) | (
                    affinities[geoms[a], None] & types[None, geoms[b]]
                )
                if meet.size and not meet.any() and frozenset((a, b)) not in explicit:
                    pairs.add(frozenset((self._bodies[a], self._bodies[b])))
        states = {
            m.key(k).name or f"key{k}": {
                name: float(m.key_qpos[k, m.jnt_qposadr[j]]) for j, name in enumerate(self._joints)
            }
            for k in range(m.nkey)
        }
        return Srdf(self._path, frozenset(pairs), states)

    def _name(self, kind: str, k: int) -> str:
        return getattr(self._model, kind)(k).name or f"{kind}{k}"

    def _followed(self) -> dict[int, tuple[int, float, float]]:
        """Return joint → the joint that it follows, with ratio and offset."""
        m, found = self._model, {}
        for k in np.flatnonzero(m.eq_active0).tolist():
            field = f"equality {m.equality(k).name or k}"
            kind = _called("mjtEq", m.eq_type[k])
            if kind != "joint" or m.eq_obj2id[k] < 0:
                expected = "a tree of links, which is not closed to a loop; joints may follow others"
                raise UrdfError(self._path, field, f"a constraint of the kind {kind}", expected)
            a, b = int(m.eq_obj1id[k]), int(m.eq_obj2id[k])
            coefficients = m.eq_data[k, :5]
            if coefficients[2:].any():
                expected = "joints that follow others in proportion: two coefficients"
                raise UrdfError(self._path, field, coefficients.tolist(), expected)
            offset, ratio = coefficients[:2].tolist()
            rest = m.qpos0[m.jnt_qposadr[[a, b]]].tolist()
            found[a] = b, ratio, rest[0] + offset - ratio * rest[1]
        return found

    def _add_joints(
        self, robot: ET.Element, body: int, followed: dict[int, tuple[int, float, float]]
    ) -> None:
        """Add the joints that move a body against its parent, with links between them if there are several.

        Each turns or moves the body about or along its axis, in the frame that those before it left:
        ``T = T_parent_body · Π Trans(anchor)·Motion(axis, q - ref)·Trans(-anchor)``.
        """
        m = self._model
        parent, name = self._bodies[m.body_parentid[body]], self._bodies[body]
        pose = from_position_quat(m.body_pos[body], m.body_quat[body])
        joints = np.flatnonzero(m.jnt_bodyid == body).tolist()
        for joint in joints:
            anchor, axis = m.jnt_pos[joint], m.jnt_axis[joint]
            kind, limits = self._kind(joint)
            rest = float(m.qpos0[m.jnt_qposadr[joint]])
            at_zero = translation(-rest * axis)
            if kind != "prismatic":
                at_zero = from_rotation(rotation_about(axis, np.array(-rest)))
            last = joint == joints[-1] and not anchor.any()
            child = name if last else f"{name}/{self._joints[joint]}"
            if not last:
                ET.SubElement(robot, "link", name=child)
            element = _add_joint(
                robot, self._joints[joint], kind, parent, child, pose @ translation(anchor) @ at_zero
            )
            ET.SubElement(element, "axis", xyz=_text(axis))
            if limits is not None:
                lower, upper = map(repr, limits)
                ET.SubElement(element, "limit", lower=lower, upper=upper, effort="0", velocity="0")
            if joint in followed:
                other, ratio, offset = followed[joint]
                names = {"joint": self._joints[other], "multiplier": repr(ratio), "offset": repr(offset)}
                ET.SubElement(element, "mimic", names)
            parent, pose = child, translation(-anchor)
        if parent != name:
            _add_joint(robot, f"{name}_fixed", "fixed", parent, name, pose)

    def _kind(self, joint: int) -> tuple[str, tuple[float, float] | None]:
        """Return what a joint is in a URDF, and its limits."""
        m = self._model
        kind = _called("mjtJoint", m.jnt_type[joint])
        if kind == "free":
            expected = "a robot with a fixed base: without the free joint, it stands where the body is"
            raise UrdfError(self._path, f"joint {self._joints[joint]}", "a free joint", expected)
        if kind == "ball":
            raise UrdfError(self._path, f"joint {self._joints[joint]}", "a ball joint", "hinges and slides")
        limits = tuple(m.jnt_range[joint].tolist()) if m.jnt_limited[joint] else None
        if kind == "slide":
            return "prismatic", limits
        return ("revolute" if limits else "continuous"), limits

    def _add_geom(self, link: ET.Element, geom: int) -> None:
        """Add what collides and what is seen of a geom; what is only seen is left out if no URDF knows it."""
        m = self._model
        seen = m.geom_group[geom] < VISIBLE and m.geom_rgba[geom, 3] > 0
        try:
            shapes = list(self._shapes(geom)) if seen or self._collides[geom] else []
        except UrdfError:
            if self._collides[geom]:
                raise
            return
        for pose, tag, sizes in shapes:
            if self._collides[geom]:
                _add_shape(link, "collision", pose, tag, sizes)
            if seen:
                visual = _add_shape(link, "visual", pose, tag, sizes)
                rgba = m.geom_rgba[geom] if m.geom_matid[geom] < 0 else m.mat_rgba[m.geom_matid[geom]]
                material = ET.SubElement(visual, "material", name=f"geom{geom}")
                ET.SubElement(material, "color", rgba=_text(rgba))

    def _shapes(self, geom: int) -> Iterator[tuple[Array, str, dict[str, str]]]:
        """Yield pose, tag and attributes of the shapes of a URDF that a geom is."""
        m, size = self._model, self._model.geom_size[geom].tolist()
        pose = from_position_quat(m.geom_pos[geom], m.geom_quat[geom])
        kind = _called("mjtGeom", m.geom_type[geom])
        if kind == "box":
            yield pose, "box", {"size": _text(2 * m.geom_size[geom])}
        elif kind == "sphere":
            yield pose, "sphere", {"radius": repr(size[0])}
        elif kind in ("cylinder", "capsule"):
            yield pose, "cylinder", {"radius": repr(size[0]), "length": repr(2 * size[1])}
            for end in (-size[1], size[1]) if kind == "capsule" else ():
                yield pose @ translation([0.0, 0.0, end]), "sphere", {"radius": repr(size[0])}
        elif kind == "mesh":
            yield self._mesh(geom, pose)
        else:
            expected = "a box, capsule, cylinder, mesh or sphere"
            if kind == "plane":
                expected = ALONE
            raise UrdfError(self._path, self._field(geom), kind, expected)

    def _mesh(self, geom: int, pose: Array) -> tuple[Array, str, dict[str, str]]:
        """Return pose, tag and attributes of a mesh: MuJoCo has moved it to its centre, and scaled it.

        Of a vertex v of the file it makes ``S·Rᵀ·(v - p)``, with the scale S, ``refpos`` p and ``refquat`` R.
        """
        m, k = self._model, int(self._model.geom_dataid[geom])
        name = m.mesh(k).name
        element = self._meshes.get(name)
        file = "" if element is None else element.get("file", "")
        if not file.lower().endswith(MESH_ENDINGS):
            raise UrdfError(self._path, f"mesh {name}", Path(file).name, "an OBJ or STL file")
        assert element is not None
        reference = [float(v) for v in element.get("refpos", "0 0 0").split()]
        turn = np.array([float(v) for v in element.get("refquat", "1 0 0 0").split()])
        R = from_position_quat([0.0, 0.0, 0.0], turn / np.linalg.norm(turn))[:3, :3]
        scale = m.mesh_scale[k]
        if not np.allclose(R, np.eye(3), atol=1e-9) and not np.allclose(scale, scale[0]):
            expected = "a refquat only of meshes with the same scale along all axes"
            raise UrdfError(self._path, f"mesh {name}", element.get("refquat"), expected)
        own = from_rotation(R.T, -(scale * (R.T @ reference)))
        moved = from_position_quat(m.mesh_pos[k], m.mesh_quat[k])
        return pose @ inverse(moved) @ own, "mesh", {"filename": file, "scale": _text(scale)}

    def _field(self, geom: int) -> str:
        body = self._bodies[self._model.geom_bodyid[geom]]
        return f"geom {self._model.geom(geom).name or geom} of body {body}"


def _called(enum: str, value: int) -> str:
    """Return what a value of one of MuJoCo's enumerations is called, such as ``hinge``."""
    return getattr(import_module("mujoco"), enum)(value).name.rpartition("_")[2].lower()


def _add_joint(robot: ET.Element, name: str, kind: str, parent: str, child: str, origin: Array) -> ET.Element:
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    _add_origin(joint, origin)
    return joint


def _add_shape(link: ET.Element, tag: str, pose: Array, shape: str, sizes: dict[str, str]) -> ET.Element:
    element = ET.SubElement(link, tag)
    _add_origin(element, pose)
    ET.SubElement(ET.SubElement(element, "geometry"), shape, sizes)
    return element


def _add_origin(element: ET.Element, pose: Array) -> None:
    ET.SubElement(element, "origin", xyz=_text(pose[:3, 3]), rpy=_text(rpy(pose)))


def _text(numbers: Any) -> str:
    return " ".join(map(repr, np.asarray(numbers, dtype=float).tolist()))
