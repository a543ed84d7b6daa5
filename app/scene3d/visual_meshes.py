"""The visual shapes of a URDF as one GLB for each link."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np
import trimesh
import yourdfpy
from trimesh.exchange.gltf import export_glb
from trimesh.graph import smooth_shade
from trimesh.visual import ColorVisuals, TextureVisuals
from trimesh.visual.material import PBRMaterial

from symgrasp.caching import kept
from symgrasp.files import file_sha256
from symgrasp.meshes import read_parts
from symgrasp.progress import Progress, cached, part_of
from symgrasp.scene.scene import Scene

from ..choices.scene_assets import BuiltScene, Visuals

__all__ = ["built_to_show", "link_visuals", "read_visuals"]

Color = tuple[int, ...]

DEFAULT_COLOR: Color = (200, 202, 206, 255)
"""Colour of shapes that have none in the URDF nor in the mesh."""

MAX_BRIGHTNESS = 235
"""Channels are clipped to this: pure white leaves no room for shading."""

MAX_TRIANGLES = 2000
"""Visuals with more triangles are simplified to this many, so that slow machines draw them smoothly."""

DECIMATION_AGGRESSION = 3
"""0 to 10: lower values keep closer to the shape, but leave more triangles."""

CREASE = np.deg2rad(30)
"""Edges of simplified meshes with a larger angle (rad) between their faces are not smoothed."""


@cached(16)
def link_visuals(urdf: bytes, progress: Progress | None) -> dict[str, bytes]:
    """Return link name → GLB in the link frame, of every link with a visual shape.

    Args:
        urdf: the robot with everything that is mounted on it, as `symgrasp.robot.model.RobotModel.urdf`
            has it.
        progress: called with the finished share; may raise `Cancelled`.

    Raises:
        MeshError: a mesh cannot be read.
    """
    robot = yourdfpy.URDF.load(io.BytesIO(urdf), build_scene_graph=False, load_meshes=False).robot
    materials = [*robot.materials, *(v.material for link in robot.links for v in link.visuals)]
    named = {m.name: m.color.rgba for m in reversed(materials) if m is not None and m.color is not None}
    glbs = {}
    for k, link in enumerate(robot.links):
        tell = partial(progress or (lambda _: None), k / len(robot.links))
        scene = trimesh.Scene()
        for visual in link.visuals:
            tell()
            _add_visual(scene, visual, link.name, named, tell)
        if scene.geometry:
            tell()
            glbs[link.name] = export_glb(scene, include_normals=True)
    return glbs


def built_to_show(scene: Scene, progress: Progress | None) -> BuiltScene:
    """Return a scene with all that is read from its files to show it.

    Args:
        scene: the scene.
        progress: called with the finished share; may raise `Cancelled`.

    Raises:
        MeshError: a mesh cannot be read.
    """
    for robot in scene.robots.values():
        for link in robot.model.colliding_links():
            if progress:
                progress(0.0)
            robot.model.hulls(link)  # kept in the model: the server draws them, but reads no uploaded file
    return BuiltScene(scene, read_visuals(scene, progress))


def read_visuals(scene: Scene, progress: Progress | None = None) -> Visuals:
    """Read every mesh of a scene that the 3D view shows, and return those of its URDFs.

    Args:
        scene: the scene.
        progress: called with the finished share; may raise `Cancelled`.

    Raises:
        MeshError: a mesh cannot be read.
    """
    models = [robot.model for robot in scene.robots.values()]
    models += [o.model for o in scene.obstacles if o.model is not None]
    for o in scene.obstacles:
        for link, shape in o.shapes():
            if shape.kind == "mesh":
                o.mesh(link, shape)
    return {
        model.urdf: link_visuals(model.urdf, part_of(progress, k, len(models)))
        for k, model in enumerate(models)
    }


def _add_visual(
    scene: trimesh.Scene,
    visual: yourdfpy.Visual,
    link: str,
    named: Mapping[str | None, np.ndarray],
    tell: Callable[[], None],
) -> None:
    meshes = _shapes(visual, link, tell)
    own = [_own_color(mesh) for mesh in meshes]
    given = named.get(visual.material.name) if visual.material is not None else None
    # The colours of a mesh with several come before the single one of the URDF; those of a mesh with
    # one do not, as that is often an exporter's grey.
    painted = len({color for color in own if color}) > 1
    origin = np.eye(4) if visual.origin is None else visual.origin
    share = MAX_TRIANGLES / sum(len(mesh.faces) for mesh in meshes)
    for mesh, color in zip(meshes, own, strict=True):
        tell()  # also between the steps, as a mesh may be large
        mesh = _simplified(mesh, share, tell)
        tell()
        if given is not None and not painted:
            color = tuple(round(255 * c) for c in given)
        paint = np.minimum(
            color or DEFAULT_COLOR, [MAX_BRIGHTNESS, MAX_BRIGHTNESS, MAX_BRIGHTNESS, 255]
        ).astype(np.uint8)
        material = PBRMaterial(baseColorFactor=paint, metallicFactor=0.0, roughnessFactor=0.55)
        mesh.visual = TextureVisuals(material=material)
        mesh.merge_vertices(merge_tex=True, merge_norm=False)
        scene.add_geometry(mesh, transform=origin)


def _own_color(mesh: trimesh.Trimesh) -> Color | None:
    if isinstance(mesh.visual, TextureVisuals):
        return tuple(int(c) for c in mesh.visual.material.main_color) if mesh.visual.defined else None
    if isinstance(mesh.visual, ColorVisuals) and mesh.visual.defined:
        return tuple(int(c) for c in mesh.visual.main_color)
    return None


def _shapes(visual: yourdfpy.Visual, link: str, tell: Callable[[], None]) -> list[trimesh.Trimesh]:
    geometry = visual.geometry
    assert geometry is not None  # the parser gives every visual one
    if geometry.box is not None:
        return [trimesh.creation.box(extents=geometry.box.size)]
    if geometry.cylinder is not None:
        return [trimesh.creation.cylinder(geometry.cylinder.radius, geometry.cylinder.length)]
    if geometry.sphere is not None:
        return [trimesh.creation.icosphere(subdivisions=3, radius=geometry.sphere.radius)]
    assert geometry.mesh is not None
    meshes = read_parts(Path(geometry.mesh.filename), f"link {link}: visual", tell)
    for mesh in meshes:
        mesh.apply_scale(np.broadcast_to(1.0 if geometry.mesh.scale is None else geometry.mesh.scale, 3))
    return meshes


def _simplified(mesh: trimesh.Trimesh, share: float, tell: Callable[[], None]) -> trimesh.Trimesh:
    """Return the shape of a mesh with this share of its triangles, or itself if that is all of them.

    It is kept on the disk, as large meshes take up to a second each.
    """
    if share >= 1.0:
        return mesh
    mesh.merge_vertices(merge_tex=True, merge_norm=True)  # where vertices are double, gaps would open

    def compute() -> tuple[np.ndarray, ...]:
        # What an edge may cost to collapse is a length of the library's own: so all have one size.
        size = float(mesh.extents.max())
        tell()
        own = trimesh.Trimesh(mesh.vertices / size, mesh.faces, process=False)
        simple = own.simplify_quadric_decimation(percent=1.0 - share, aggression=DECIMATION_AGGRESSION)
        tell()
        shaded = smooth_shade(simple, angle=CREASE)
        return shaded.vertices * size, shaded.faces

    content = hashlib.sha256(np.ascontiguousarray(mesh.vertices).tobytes())
    content.update(np.ascontiguousarray(mesh.faces).tobytes())
    program = file_sha256(Path(__file__)), version("fast_simplification")
    vertices, faces = kept(("simplified", content.hexdigest(), share, *program), compute)
    tell()
    return trimesh.Trimesh(vertices, faces, process=False)
