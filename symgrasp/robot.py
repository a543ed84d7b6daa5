"""Robots from URDF: the tree of joints, forward kinematics, limits, and the arms that grasp."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import trimesh
import yourdfpy
from numpy.typing import ArrayLike

from symgrasp.assembly import Mount, assemble
from symgrasp.errors import InputError, UrdfError, one_of
from symgrasp.files import resolve
from symgrasp.hand import Hand
from symgrasp.handprint import Handprint, handprint
from symgrasp.manifold import Manifold
from symgrasp.meshes import read_mesh
from symgrasp.poses import Array, from_rotation, inverse, rotation_about

__all__ = ["Arm", "Joint", "Robot", "RobotModel"]

LARGEST_LIMIT = 1e4
"""No joint turns or slides further than this (rad or m)."""

MOVING = ("revolute", "continuous", "prismatic")


@dataclass(frozen=True, eq=False)
class Joint:
    """One joint of the tree.

    Attributes:
        origin: pose (4, 4) of the joint in its parent link at zero.
        axis: unit axis (3,) in the joint frame.
        lower: lower limit (rad or m); -inf for a continuous joint.
        upper: upper limit.
        source: index into the robot's joint values, or -1 for a fixed joint.
        ratio: value of this joint for each unit of the source (1 unless it mimics).
        offset: value of this joint where the source is zero.
    """

    name: str
    kind: str
    parent: int
    child: int
    origin: Array
    axis: Array
    lower: float
    upper: float
    source: int
    ratio: float = 1.0
    offset: float = 0.0


class RobotModel:
    """The kinematic tree of a URDF and the shapes of its links.

    Args:
        path: the URDF file.
        mounts: hands and frames that the file does not have.

    Raises:
        UrdfError: a file is missing, not a URDF, uses an unknown joint type, or refers to a
            mesh that does not exist; or a mount does not fit.

    Attributes:
        path: the URDF file.
        urdf: the URDF with all that is mounted, every mesh as an absolute path.
        name: the robot's name in it.
        link_names: all links; the first is the root.
        joints: all joints, parents before children.
        joint_names: the joints that take a value: neither fixed nor mimic.
        lower: their lower limits (n,).
        upper: their upper limits (n,).
    """

    def __init__(self, path: Path, mounts: Sequence[Mount] = ()) -> None:
        self.path = Path(path)
        self.urdf = assemble(self.path, mounts)
        try:
            urdf = yourdfpy.URDF.load(io.BytesIO(self.urdf), build_scene_graph=False, load_meshes=False)
            self.name = str(urdf.robot.name)
            root = _root_link(urdf)
        except Exception as error:  # the parser raises whatever its XML library raises
            raise UrdfError(path, "urdf", str(error), "a valid URDF document") from error
        self._collisions = {link.name: list(link.collisions) for link in urdf.robot.links}
        for link, shapes in self._collisions.items():
            for shape in shapes:
                _check_shape(self.path, link, shape)
        self._hulls: dict[str, tuple[Array, ...]] = {}
        self.joint_names = tuple(j.name for j in urdf.robot.joints if j.type in MOVING and j.mimic is None)
        self.joints, self.link_names = self._build_tree(urdf, root)
        by_name = {joint.name: joint for joint in self.joints}
        self.lower = np.array([by_name[name].lower for name in self.joint_names])
        self.upper = np.array([by_name[name].upper for name in self.joint_names])

    def mesh_path(self, reference: str, link: str = "mesh") -> Path:
        """Return the file behind a mesh reference of this URDF.

        Raises:
            UrdfError: there is no such file.
        """
        path = resolve(reference, self.path.parent)
        if path is None:
            raise UrdfError(self.path, f"link {link}", reference, "an existing mesh file")
        return path

    def _build_tree(self, urdf: yourdfpy.URDF, root: str) -> tuple[tuple[Joint, ...], tuple[str, ...]]:
        links = [root]
        joints: list[Joint] = []
        index = {name: i for i, name in enumerate(self.joint_names)}
        remaining = list(urdf.robot.joints)
        while remaining:
            ready = [j for j in remaining if j.parent in links]
            if not ready:
                raise UrdfError(self.path, "joint", remaining[0].name, "a parent link that hangs on the root")
            for j in ready:
                if j.type != "fixed" and j.type not in MOVING:
                    raise UrdfError(self.path, f"joint {j.name}", j.type, one_of((*MOVING, "fixed")))
                links.append(j.child)
                joints.append(self._joint(j, index, links))
            remaining = [j for j in remaining if j not in ready]
        return tuple(joints), tuple(links)

    def _joint(self, j: yourdfpy.Joint, index: Mapping[str, int], links: list[str]) -> Joint:
        origin = np.eye(4) if j.origin is None else np.asarray(j.origin, dtype=float)
        axis = np.array([1.0, 0.0, 0.0] if j.axis is None else j.axis, dtype=float)
        source, ratio, offset = -1, 1.0, 0.0
        lower, upper = -np.inf, np.inf
        if j.type in MOVING:
            length = np.linalg.norm(axis)
            if length < 1e-9:
                raise UrdfError(self.path, f"joint {j.name}: axis", axis.tolist(), "a direction")
            axis = axis / length
            if j.mimic is not None:
                if j.mimic.joint not in index:
                    raise UrdfError(self.path, f"joint {j.name}: mimic", j.mimic.joint, one_of(index))
                source = index[j.mimic.joint]
                ratio = 1.0 if j.mimic.multiplier is None else float(j.mimic.multiplier)
                offset = 0.0 if j.mimic.offset is None else float(j.mimic.offset)
            else:
                source = index[j.name]
            if j.type != "continuous":
                if j.limit is None or j.limit.lower is None or j.limit.upper is None:
                    raise UrdfError(self.path, f"joint {j.name}: limit", None, "a lower and an upper limit")
                lower, upper = float(j.limit.lower), float(j.limit.upper)
                if not -LARGEST_LIMIT <= lower <= upper <= LARGEST_LIMIT:
                    raise UrdfError(self.path, f"joint {j.name}: limit", [lower, upper], "lower <= upper")
        return Joint(
            j.name, j.type, links.index(j.parent), links.index(j.child), origin, axis, lower, upper,
            source, ratio, offset,
        )  # fmt: skip

    @property
    def root(self) -> str:
        """The link that everything hangs on."""
        return self.link_names[0]

    def link_index(self, link: str) -> int:
        """Return the index of a link.

        Raises:
            UrdfError: there is no such link.
        """
        if link not in self.link_names:
            raise UrdfError(self.path, "link", link, one_of(self.link_names, link))
        return self.link_names.index(link)

    def default_values(self) -> Array:
        """Return joint values (n,): zero, or the nearest limit where zero is outside."""
        return np.clip(np.zeros(len(self.joint_names)), self.lower, self.upper)

    def forward(self, q: ArrayLike) -> Array:
        """Return the poses (..., links, 4, 4) of all links in the root frame.

        Args:
            q: values (..., n) of `joint_names`.
        """
        q = np.asarray(q, dtype=float)
        poses = np.zeros((*q.shape[:-1], len(self.link_names), 4, 4))
        poses[..., 0, :, :] = np.eye(4)
        for joint in self.joints:
            pose = poses[..., joint.parent, :, :] @ joint.origin
            if joint.source >= 0:
                pose = pose @ _motion(joint, joint.ratio * q[..., joint.source] + joint.offset)
            poses[..., joint.child, :, :] = pose
        return poses

    def chain(self, link: str) -> list[Joint]:
        """Return the joints from the root to a link."""
        by_child = {joint.child: joint for joint in self.joints}
        joints: list[Joint] = []
        at = self.link_index(link)
        while at:
            joints.insert(0, by_child[at])
            at = by_child[at].parent
        return joints

    def mount_links(self) -> frozenset[str]:
        """Return the links that no joint moves."""
        return frozenset(name for name in self.link_names if not any(j.source >= 0 for j in self.chain(name)))

    def colliding_links(self) -> tuple[str, ...]:
        """Return the links that have a collision shape."""
        return tuple(filter(self.has_shape, self.link_names))

    def neighbours(self) -> frozenset[frozenset[str]]:
        """Return the pairs of links with shapes that a joint, or only shapeless links, connect."""
        solid = set(self.colliding_links())
        anchor: dict[str, str | None] = {self.root: self.root if self.root in solid else None}
        pairs = set()
        for joint in self.joints:
            parent, child = self.link_names[joint.parent], self.link_names[joint.child]
            above = anchor[parent]
            if child in solid and above is not None:
                pairs.add(frozenset((above, child)))
            anchor[child] = child if child in solid else above
        return frozenset(pairs)

    def hulls(self, link: str) -> tuple[Array, ...]:
        """Return the vertices (n, 3) of the convex hull of each collision shape, in the link frame."""
        if link not in self._hulls:
            hulls = []
            for shape in self._collisions[link]:
                origin = np.eye(4) if shape.origin is None else np.asarray(shape.origin, dtype=float)
                hulls.append(_hull(shape, self.mesh_path, link) @ origin[:3, :3].T + origin[:3, 3])
            self._hulls[link] = tuple(hulls)
        return self._hulls[link]

    def has_shape(self, link: str) -> bool:
        """Whether a link has a collision shape."""
        return bool(self._collisions[link])

    def __eq__(self, other: object) -> bool:
        """Models of the same URDF are equal, so what is found out about one serves the other."""
        return isinstance(other, RobotModel) and self.urdf == other.urdf

    def __hash__(self) -> int:
        return hash(self.urdf)

    def collision_urdf(self) -> bytes:
        """Return the URDF without what is only seen; every link has a mass, or PyBullet complains."""
        root = ET.fromstring(self.urdf)
        for link in root.iter("link"):
            for visual in link.findall("visual"):
                link.remove(visual)
            if link.find("inertial") is None:
                inertial = ET.SubElement(link, "inertial")
                ET.SubElement(inertial, "mass", value="1")
                moments = {"ixx": "1", "ixy": "0", "ixz": "0", "iyy": "1", "iyz": "0", "izz": "1"}
                ET.SubElement(inertial, "inertia", moments)
        return ET.tostring(root)


def _check_shape(path: Path, link: str, shape: yourdfpy.Collision) -> None:
    """Check the sizes of a collision shape; a mesh may be mirrored by a negative scale.

    Raises:
        UrdfError: a size is not a positive number, or a scale is zero or none.
    """
    geometry = shape.geometry
    if geometry is None:
        raise UrdfError(path, f"link {link}: collision", None, "a geometry")
    sizes: list[float] = []
    if geometry.box is not None:
        sizes = list(np.ravel(geometry.box.size))
    elif geometry.cylinder is not None:
        sizes = [geometry.cylinder.radius, geometry.cylinder.length]
    elif geometry.sphere is not None:
        sizes = [geometry.sphere.radius]
    elif geometry.mesh is not None and geometry.mesh.scale is not None:
        sizes = list(np.abs(np.ravel(geometry.mesh.scale)))
    if not all(0 < size < LARGEST_LIMIT for size in sizes):
        shown = [float(size) for size in sizes]
        raise UrdfError(path, f"link {link}: collision", shown, "sizes that are positive numbers")


def _root_link(urdf: yourdfpy.URDF) -> str:
    children = {joint.child for joint in urdf.robot.joints}
    roots = [link.name for link in urdf.robot.links if link.name not in children]
    if len(roots) != 1:
        raise ValueError(f"{len(roots)} root links {roots}")
    return roots[0]


def _motion(joint: Joint, value: Array) -> Array:
    if joint.kind == "prismatic":
        return from_rotation(np.eye(3), value[..., None] * joint.axis)
    return from_rotation(rotation_about(joint.axis, value))


def _hull(shape: yourdfpy.Collision, find: Callable[[str, str], Path], link: str) -> Array:
    geometry = shape.geometry
    assert geometry is not None  # the parser requires it
    if geometry.box is not None:
        mesh = trimesh.creation.box(extents=geometry.box.size)
    elif geometry.cylinder is not None:
        # Circumscribed, so that the hull contains the round shape.
        sides = 48
        mesh = trimesh.creation.cylinder(
            radius=geometry.cylinder.radius / np.cos(np.pi / sides),
            height=geometry.cylinder.length,
            sections=sides,
        )
    elif geometry.sphere is not None:
        ball = trimesh.creation.icosphere(subdivisions=3)
        inradius = np.einsum("ij,ij->i", ball.face_normals, ball.triangles_center).min()
        mesh = ball.apply_scale(geometry.sphere.radius / inradius)
    else:
        assert geometry.mesh is not None  # the parser knows no other shape
        mesh = read_mesh(find(geometry.mesh.filename, link), f"link {link}")
        scale = geometry.mesh.scale
        mesh.apply_scale(1.0 if scale is None else scale)
    return np.asarray(mesh.convex_hull.vertices)


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot placed in the world.

    Attributes:
        name: its name in the scene.
        model: its URDF.
        T_world_base: pose (4, 4) of the root link.
        home: parked joint values (n,) of ``model.joint_names``.
    """

    name: str
    model: RobotModel
    T_world_base: Array
    home: Array


class Arm:
    """The chain of joints from a robot's base to a tool with a hand: what grasps.

    All other joints of the robot rest at home, prismatic ones and those that another arm of the
    robot shares among them. Kinematics is a product of exponentials read off the URDF:
    ``T_base_tool(q) = Trans(P0)·Rot(H0, q0)·Trans(P1)· … ·Rot(Hn-1, qn-1)·Trans(Pn)·R0``.

    Args:
        name: its name in the scene.
        robot: whose arm it is.
        tool: the tool link.
        hand: the hand at the tool.
        shared: joints of the chain that belong to another arm as well.

    Raises:
        UrdfError: the tool, a hand link or a hand joint is not in the URDF, or the chain has
            neither 6 nor 7 revolute joints.

    Attributes:
        joint_names: its n joints, from base to tool.
        lower: joint limits (n,), -inf for a continuous joint.
        upper: joint limits (n,), inf for a continuous joint.
        H: unit axes (n, 3) in the base frame at zero.
        P: offsets (n + 1, 3) between points on successive axes, at zero.
        R0: orientation (3, 3) of the tool at zero.
    """

    def __init__(
        self, name: str, robot: Robot, tool: str, hand: Hand, shared: frozenset[str] = frozenset()
    ) -> None:
        model = robot.model
        if tool not in model.link_names:
            raise UrdfError(model.path, "tool", tool, one_of(model.link_names, tool))
        for link in (*hand.links, *hand.touch_links):
            if link not in model.link_names:
                raise UrdfError(model.path, f"hand {hand.name}: link", link, one_of(model.link_names, link))
        for joint in hand.joints:
            if joint not in model.joint_names:
                raise UrdfError(
                    model.path, f"hand {hand.name}: joint", joint, one_of(model.joint_names, joint)
                )
        self.name, self.robot, self.tool, self.hand = name, robot, tool, hand
        joints = [
            j
            for j in model.chain(tool)
            if j.source >= 0 and j.kind != "prismatic" and j.name not in shared and j.name not in hand.joints
        ]
        if len(joints) not in (6, 7):
            names = [j.name for j in joints]
            raise UrdfError(model.path, f"arm {name}", names, f"6 or 7 revolute joints, not {len(joints)}")
        self.joint_names = tuple(j.name for j in joints)
        self.indices = np.array([model.joint_names.index(n) for n in self.joint_names])
        self.lower, self.upper = model.lower[self.indices], model.upper[self.indices]
        self.H, self.P, self.R0 = self._screws(joints)

    def _screws(self, joints: list[Joint]) -> tuple[Array, Array, Array]:
        q = self.robot.home.copy()
        q[self.indices] = 0.0
        links = self.robot.model.forward(q)
        frames = [links[j.child] for j in joints]
        points = [np.zeros(3), *(frame[:3, 3] for frame in frames), links[self._tool_index][:3, 3]]
        H = np.array([frame[:3, :3] @ joint.axis for frame, joint in zip(frames, joints, strict=True)])
        return H, np.diff(points, axis=0), links[self._tool_index][:3, :3]

    @cached_property
    def _tool_index(self) -> int:
        return self.robot.model.link_index(self.tool)

    @property
    def dof(self) -> int:
        """Number of joints."""
        return len(self.joint_names)

    @property
    def home(self) -> Array:
        """Parked joint values (n,) of the arm."""
        return self.robot.home[self.indices]

    def tool_pose(self, q: ArrayLike) -> Array:
        """Return ``T_base_tool`` (..., 4, 4) for joint values (..., n)."""
        q = np.asarray(q, dtype=float)
        rotation = np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3))
        position = np.broadcast_to(self.P[0], (*q.shape[:-1], 3))
        for k, axis in enumerate(self.H):
            rotation = rotation @ rotation_about(axis, q[..., k])
            position = position + rotation @ self.P[k + 1]
        return from_rotation(rotation @ self.R0, position)

    def world_tool_pose(self, q: ArrayLike) -> Array:
        """Return ``T_world_tool`` (..., 4, 4) for joint values (..., n)."""
        return self.robot.T_world_base @ self.tool_pose(q)

    def within_limits(self, q: ArrayLike) -> tuple[Array, np.ndarray]:
        """Take the full turns that bring joint values (..., n) inside the limits, if any do.

        The turn nearest to the middle of the range fits whenever any turn does.

        Returns:
            The turned joint values (..., n), and whether all of them are inside (...).
        """
        q = np.asarray(q, dtype=float)
        bounded = np.isfinite(self.lower) & np.isfinite(self.upper)
        middle = np.where(
            bounded, 0.5 * (np.where(bounded, self.lower, 0) + np.where(bounded, self.upper, 0)), 0
        )
        q = q + 2 * np.pi * np.round((middle - q) / (2 * np.pi))
        return q, np.all((q >= self.lower) & (q <= self.upper), axis=-1)

    def robot_values(self, q: ArrayLike, opening: float | None = None) -> Array:
        """Return values (N,) of all the robot's joints: this arm at ``q`` (n,), the rest at home.

        Args:
            q: joint values of the arm.
            opening: opening (m) of the hand; None leaves the hand at home.
        """
        values = self.robot.home.copy()
        values[self.indices] = q
        if opening is not None:
            for joint, value in self.hand.joint_values(opening).items():
                values[self.robot.model.joint_names.index(joint)] = value
        return values

    def hand_bodies(self, opening: float) -> list[Array]:
        """Return the vertices (n, 3) of the hand's convex bodies in the tool frame at an opening (m)."""
        model = self.robot.model
        links = model.forward(self.robot_values(self.home, opening))
        T_tool_base = inverse(links[self._tool_index])
        bodies = []
        for link in self.hand.links:
            pose = T_tool_base @ links[model.link_index(link)]
            bodies += [points @ pose[:3, :3].T + pose[:3, 3] for points in model.hulls(link)]
        if not bodies:
            raise InputError(model.path, f"hand {self.hand.name}", list(self.hand.links), "links with bodies")
        return bodies

    def handprint(self, manifold: Manifold, row: int, roll: int) -> Handprint:
        """Return the print of the hand that grasps a row at column 0, open as it is at that height."""
        radius = float(manifold.profile.radius(manifold.h[row]))
        bodies = self.hand_bodies(self.hand.opening(radius))
        return handprint(bodies, manifold, row, roll, self.hand.standoff(radius))
