"""The kinematic tree of a URDF: joints, limits, forward kinematics, and the collision shapes of links."""

from __future__ import annotations

import hashlib
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from symgrasp.descriptions.description import read_description
from symgrasp.descriptions.srdf import read_srdf
from symgrasp.descriptions.urdf import UrdfJoint, UrdfRobot, read_urdf
from symgrasp.errors import UrdfError, one_of
from symgrasp.poses import Array
from symgrasp.robot.assembly import Mount, assemble
from symgrasp.robot.joint import DEFAULT_VELOCITY, Joint, JointMotions
from symgrasp.robot.link_mass import link_mass
from symgrasp.robot.link_shapes import CollisionShape, collision_hulls, link_shape

__all__ = ["RobotModel"]

LARGEST_LIMIT = 1e4
"""A joint limit beyond this (rad or m) is none."""

ROWS = 256
"""Joint values that `RobotModel.forward_rows` takes at a time."""

MOVING = ("revolute", "continuous", "prismatic")


class RobotModel:
    """The kinematic tree of a URDF and the collision shapes of its links.

    Models of equal content are equal, so that what is computed for one serves its copies too.

    Args:
        path: the file: a URDF, or one that `read_description` makes a URDF of.
        mounts: hands and tool frames to add to what the file holds.
        srdf: the file with the robot's semantic description; None where it has none.
        xacro_args: values of the arguments of a xacro file.
        follow_up_axis: see `assemble`.

    Raises:
        UrdfError: a file is missing, not a URDF, uses an unknown joint type, or refers to a
            mesh that does not exist; or a mount does not fit.

    Attributes:
        path: the file.
        urdf: text of the URDF with the mounts added, every mesh as an absolute path.
        sha256: SHA-256 of that URDF, of its collision meshes and of the links that may touch, as they were
            when it was loaded.
        srdf: the semantic description; None where there is none.
        name: the robot's name in the URDF.
        link_names: all links; the first is the root.
        joints: all joints, parents before children.
        joint_names: the joints that take a value: neither fixed nor mimic.
        lower: their lower limits (n,), -inf where there is none.
        upper: their upper limits (n,), inf where there is none.
        velocity: their largest speeds (n,) (rad/s or m/s), `DEFAULT_VELOCITY` where the file states none.
    """

    def __init__(
        self,
        path: Path,
        mounts: Sequence[Mount] = (),
        srdf: Path | None = None,
        xacro_args: Mapping[str, str] | None = None,
        *,
        follow_up_axis: bool = False,
    ) -> None:
        self.path = Path(path)
        description = read_description(self.path, xacro_args)
        self.srdf = description.srdf if srdf is None else read_srdf(srdf)
        self.urdf = assemble(self.path, mounts, description.urdf, follow_up_axis=follow_up_axis)
        try:
            with np.errstate(all="ignore"):  # numbers that are not finite are refused below
                urdf = read_urdf(ET.fromstring(self.urdf))
            self.name = urdf.name
            root = _root_link(urdf)
        except (KeyError, ValueError) as error:
            raise UrdfError(path, "urdf", str(error), "a valid URDF document") from error
        self._shapes = {
            link.name: tuple(link_shape(self.path, link.name, shape) for shape in link.collisions)
            for link in urdf.links
        }
        inertials = {link.name: link_mass(self.path, link) for link in urdf.links}
        self.sha256 = self._content_sha256()
        self._hulls: dict[str, tuple[tuple[Array, ...], ...]] = {}
        self.joint_names = tuple(j.name for j in urdf.joints if j.type in MOVING and j.mimic is None)
        self._indices = {name: k for k, name in enumerate(self.joint_names)}
        self._unusable_limits: dict[str, tuple[float, float] | None] = {}  # as the URDF states them
        self.joints, self.link_names = self._build_tree(urdf, root)
        self._link_indices = {link: k for k, link in enumerate(self.link_names)}
        self._motions = JointMotions(self.joints)
        self._to_link: dict[str, tuple[list[Joint], JointMotions]] = {}  # those that were asked for
        self._above = {joint.child: joint for joint in self.joints}
        mass, centre = zip(*(inertials[link] for link in self.link_names), strict=True)
        self._masses = np.array(mass), np.array(centre)
        by_name = {joint.name: joint for joint in self.joints}
        self.lower = np.array([by_name[name].lower for name in self.joint_names])
        self.upper = np.array([by_name[name].upper for name in self.joint_names])
        self.velocity = np.array([by_name[name].velocity for name in self.joint_names])

    def _content_sha256(self) -> str:
        """Hash the URDF and the files of its collision meshes; meshes that are only seen are left out."""
        digest = hashlib.sha256(self.urdf)
        for shapes in self._shapes.values():
            for shape in shapes:
                digest.update(shape.sha256.encode())
        if allowed := sorted(sorted(pair) for pair in self.allowed_pairs()):
            digest.update(repr(allowed).encode())
        return digest.hexdigest()

    def allowed_pairs(self) -> frozenset[frozenset[str]]:
        """Return the pairs of the robot's links that its SRDF lets touch."""
        disabled = self.srdf.disabled if self.srdf else frozenset[frozenset[str]]()
        return frozenset(pair for pair in disabled if pair <= self._shapes.keys())

    def _build_tree(self, urdf: UrdfRobot, root: str) -> tuple[tuple[Joint, ...], tuple[str, ...]]:
        """Return joints and link names in the order of a breadth-first walk from the root.

        Raises:
            UrdfError: a joint is not connected to the root, of an unknown type, or moves no link.
        """
        links = {root: 0}
        joints: list[Joint] = []
        by_name = {j.name: j for j in urdf.joints}
        order = {j.name: k for k, j in enumerate(urdf.joints)}
        below: dict[str, list[UrdfJoint]] = {}
        for j in urdf.joints:
            below.setdefault(j.parent, []).append(j)
        ready = below.pop(root, [])
        while ready:
            for j in ready:
                if j.type != "fixed" and j.type not in MOVING:
                    raise UrdfError(self.path, f"joint {j.name}", j.type, one_of((*MOVING, "fixed")))
                if j.child not in self._shapes:
                    expected = one_of(self._shapes, j.child)
                    raise UrdfError(self.path, f"joint {j.name}: child", j.child, expected)
                links[j.child] = len(links)
                joints.append(self._joint(j, by_name, links))
            ready = sorted((b for j in ready for b in below.pop(j.child, [])), key=lambda j: order[j.name])
        for hanging in below.values():
            raise UrdfError(self.path, "joint", hanging[0].name, "a parent link that hangs on the root")
        return tuple(joints), tuple(links)

    def _joint(self, j: UrdfJoint, by_name: Mapping[str, UrdfJoint], links: Mapping[str, int]) -> Joint:
        """Convert a joint of the URDF; ``by_name`` holds all of them, ``links`` the indices of the links.

        Raises:
            UrdfError: its origin, axis or mimic reference is unusable.
        """
        if not np.isfinite(j.origin).all():
            raise UrdfError(self.path, f"joint {j.name}: origin", j.origin[:3, 3].tolist(), "finite numbers")
        axis = j.axis
        source, ratio, offset = -1, 1.0, 0.0
        lower, upper = -np.inf, np.inf
        if j.type in MOVING:
            length = np.linalg.norm(axis)
            if not 1e-9 < length < np.inf:
                raise UrdfError(self.path, f"joint {j.name}: axis", axis.tolist(), "a direction")
            axis = axis / length
            followed, ratio, offset = self._followed(j, by_name)
            source = self._indices[followed.name]
            if j.mimic is None or j.type == "continuous" or _stated_limits(j):
                lower, upper = self._limits(j)
            else:  # as far as the joint that it mimics takes it
                ends = [ratio * end + offset if ratio else offset for end in self._limits(followed)]
                lower, upper = min(ends), max(ends)
        return Joint(
            j.name, j.type, links[j.parent], links[j.child], j.origin, axis, lower, upper,
            source, ratio, offset, _stated_velocity(j),
        )  # fmt: skip

    def _followed(self, j: UrdfJoint, by_name: Mapping[str, UrdfJoint]) -> tuple[UrdfJoint, float, float]:
        """Return the joint that a joint follows in the end, itself unless it mimics, with ratio and offset.

        Raises:
            UrdfError: it mimics a joint that takes no value, or itself in a circle.
        """
        ratio, offset, at, seen = 1.0, 0.0, j, [j.name]
        while at.mimic is not None:
            where, name = f"joint {at.name}: mimic", at.mimic.joint
            target = by_name.get(name)
            if target is None or target.type not in MOVING:
                raise UrdfError(self.path, where, name, one_of(self.joint_names, name))
            if name in seen:
                raise UrdfError(self.path, where, name, "a joint that does not mimic this one in turn")
            seen.append(name)
            offset += ratio * at.mimic.offset
            ratio *= at.mimic.multiplier
            at = target
        if not (np.isfinite(ratio) and np.isfinite(offset)):
            raise UrdfError(self.path, f"joint {j.name}: mimic", [ratio, offset], "finite numbers")
        return at, ratio, offset

    def _limits(self, j: UrdfJoint) -> tuple[float, float]:
        """Return the limits of a joint of the URDF, infinite where there are none.

        Those that are missing or not in order are noted: they matter only if the joint is used.
        """
        if j.type == "continuous":
            return -np.inf, np.inf
        limits = _stated_limits(j)
        if limits is None or not limits[0] <= limits[1]:
            self._unusable_limits[j.name] = limits
            return -np.inf, np.inf
        lower, upper = limits
        return lower if lower >= -LARGEST_LIMIT else -np.inf, upper if upper <= LARGEST_LIMIT else np.inf

    def check_limits(self, joints: Iterable[str]) -> None:
        """Check that the URDF has limits for the joints of an arm or a hand, given by name.

        Raises:
            UrdfError: they are missing for one, or not in order.
        """
        for name in joints:
            if name in self._unusable_limits:
                expected = "a lower and an upper limit, the lower one first"
                raise UrdfError(self.path, f"joint {name}: limit", self._unusable_limits[name], expected)

    @property
    def root(self) -> str:
        """The root link of the tree."""
        return self.link_names[0]

    def link_index(self, link: str) -> int:
        """Return the index of a link.

        Raises:
            UrdfError: there is no such link.
        """
        if link not in self._link_indices:
            raise UrdfError(self.path, "link", link, one_of(self.link_names, link))
        return self._link_indices[link]

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
        motions, k = self._motions.poses(q), 0
        for joint in self.joints:
            pose = poses[..., joint.parent, :, :] @ joint.origin
            if joint.source >= 0:
                pose = pose @ motions[..., k, :, :]
                k += 1
            poses[..., joint.child, :, :] = pose
        return poses

    def forward_rows(self, q: Array, trying: Callable[[], None]) -> Array:
        """Return what `forward` does for many values (m, n), in parts.

        Args:
            q: values (m, n) of `joint_names`.
            trying: called before every part; may raise `Cancelled`.
        """
        poses = np.empty((len(q), len(self.link_names), 4, 4))
        for k in range(0, len(q), ROWS):
            trying()
            poses[k : k + ROWS] = self.forward(q[k : k + ROWS])
        return poses

    def link_pose(self, q: ArrayLike, link: str) -> Array:
        """Return the pose (..., 4, 4) of one link in the root frame: what `forward` says of it.

        Args:
            q: values (..., n) of `joint_names`.
            link: the link.

        Raises:
            UrdfError: there is no such link.
        """
        q = np.asarray(q, dtype=float)
        if link not in self._to_link:
            chain = self.chain(link)
            self._to_link[link] = chain, JointMotions(chain)
        chain, motions = self._to_link[link]
        pose, moved, k = np.broadcast_to(np.eye(4), (*q.shape[:-1], 4, 4)), motions.poses(q), 0
        for joint in chain:
            pose = pose @ joint.origin
            if joint.source >= 0:
                pose = pose @ moved[..., k, :, :]
                k += 1
        return pose

    def masses(self) -> tuple[Array, Array]:
        """Return the masses (links,) (kg), and the centres of mass (links, 3) in the link frames."""
        return self._masses

    def chain(self, link: str) -> list[Joint]:
        """Return the joints on the path from the root to a link, fixed ones included."""
        joints: list[Joint] = []
        at = self.link_index(link)
        while at:
            joints.append(self._above[at])
            at = self._above[at].parent
        return joints[::-1]

    def mount_links(self) -> frozenset[str]:
        """Return the links that no joint moves: the root and what is fixed to it."""
        still = {0}
        for joint in self.joints:  # parents before children
            if joint.source < 0 and joint.parent in still:
                still.add(joint.child)
        return frozenset(self.link_names[k] for k in still)

    def colliding_links(self) -> tuple[str, ...]:
        """Return the links that have a collision shape."""
        return tuple(filter(self.has_shape, self.link_names))

    def neighbours(self) -> frozenset[frozenset[str]]:
        """Return the pairs of links with collision shapes that are adjacent in the tree.

        Links without a shape between two links do not keep them from being adjacent.
        """
        colliding = set(self.colliding_links())
        # link → nearest link with a shape, from it up to the root
        nearest: dict[str, str | None] = {self.root: self.root if self.root in colliding else None}
        pairs = set()
        for joint in self.joints:
            parent, child = self.link_names[joint.parent], self.link_names[joint.child]
            above = nearest[parent]
            if child in colliding and above is not None:
                pairs.add(frozenset((above, child)))
            nearest[child] = child if child in colliding else above
        return frozenset(pairs)

    def hulls(self, link: str) -> tuple[Array, ...]:
        """Return the vertices (n, 3) of the convex hulls of a link's collision shapes, in the link frame.

        Raises:
            MeshError: a mesh is unusable.
        """
        return tuple(hull for hulls in self.shape_hulls(link) for hull in hulls)

    def shape_hulls(self, link: str) -> tuple[tuple[Array, ...], ...]:
        """Return the hulls of each collision shape of a link: one, or several for a mesh; see `hulls`."""
        if link not in self._hulls:
            field = f"link {link} of {self.path.name}"
            self._hulls[link] = tuple(collision_hulls(shape, field) for shape in self._shapes[link])
        return self._hulls[link]

    def shapes(self, link: str) -> tuple[CollisionShape, ...]:
        """Return the collision shapes of a link."""
        return self._shapes[link]

    def has_shape(self, link: str) -> bool:
        """Whether a link has a collision shape."""
        return bool(self._shapes[link])

    def __getstate__(self) -> dict[str, Any]:
        """Return a copy of the attributes to pickle: another thread may read a hull meanwhile."""
        return {**self.__dict__, "_hulls": dict(self._hulls)}

    def __eq__(self, other: object) -> bool:
        """Models of the same files are equal, so results cached for one serve the other."""
        return isinstance(other, RobotModel) and self.sha256 == other.sha256

    def __hash__(self) -> int:
        return hash(self.sha256)


def _stated_limits(j: UrdfJoint) -> tuple[float, float] | None:
    if j.limit is None or j.limit.lower is None or j.limit.upper is None:
        return None
    return j.limit.lower, j.limit.upper


def _stated_velocity(j: UrdfJoint) -> float:
    stated = j.limit.velocity if j.limit is not None else None
    return stated if stated is not None and 0 < stated < np.inf else DEFAULT_VELOCITY


def _root_link(urdf: UrdfRobot) -> str:
    """Return the only link that is no child of a joint; raise ValueError where there are none or several."""
    children = {joint.child for joint in urdf.joints}
    roots = [link.name for link in urdf.links if link.name not in children]
    if len(roots) != 1:
        raise ValueError(f"{len(roots)} root links {roots}")
    return roots[0]
