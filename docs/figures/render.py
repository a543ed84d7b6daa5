"""A small ray tracer for clean pictures on white: soft shadows, ambient occlusion, no GPU.

Colours are sRGB; light is added up in linear space. A surface in full light shows its own colour,
so a cell of a map has the colour of the legend.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from symgrasp.poses import Array

__all__ = ["Body", "Camera", "Paint", "Picture", "render"]

Paint = Callable[[Array], Array]
"""Points (n, 3) of the world on a surface → their sRGB colours (n, 3), 0 to 1."""

SAMPLES = 4
"""Rays along each side of a pixel."""

SKY_RAYS = 3
"""Rays of ambient occlusion for each of them."""

EVEN = np.array([0.7548776662466927, 0.5698402909980532])
"""Multiples of this, modulo 1, fill the unit square evenly: far less grain than chance makes."""

REACH = 0.2
"""Things further away (m) than this take no ambient light."""

HAIR = 2e-5
"""New rays begin this far (m) above the surface."""

KEY, SKY, HEADLIGHT = 0.40, 0.38, 0.28
"""Shares of the light: a lamp above the viewer's left shoulder, all around, and from the viewer."""

SOFTNESS = 0.09
"""Radius of the lamp against its distance."""


class Camera(NamedTuple):
    """Where a picture is taken from.

    Attributes:
        look_at: the point (3,) in the middle.
        azimuth: direction (degrees) from there to the camera, about the world's z.
        elevation: its height above the horizon (degrees).
        width: how much (m) is seen at that point from left to right.
        view: angle (degrees) between the left and the right edge; small is nearly parallel.
    """

    look_at: tuple[float, float, float]
    azimuth: float
    elevation: float
    width: float
    view: float = 24.0

    def axes(self) -> Array:
        """Return right, up and towards the viewer as rows (3, 3)."""
        a, e = np.deg2rad([self.azimuth, self.elevation])
        back = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return np.stack([right, np.cross(back, right), back])

    def eye(self) -> Array:
        """Return where the camera stands (3,)."""
        distance = self.width / (2 * np.tan(np.deg2rad(self.view) / 2))
        return np.asarray(self.look_at) + distance * self.axes()[2]


@dataclass(frozen=True, eq=False)
class Body:
    """Triangles of one look.

    Attributes:
        corners: (n, 3, 3) in the world (m).
        normals: (n, 3, 3) at the corners.
        color: sRGB (3,), 0 to 1, or what gives the points of the surface theirs.
        floor: whether it is white paper, of which only the shadows are seen.
    """

    corners: Array
    normals: Array
    color: Array | Paint
    floor: bool = False

    def colors(self, points: Array) -> Array:
        """Return the colours (n, 3) at points (n, 3)."""
        return self.color(points) if callable(self.color) else np.tile(self.color, (len(points), 1))


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture and how it was taken.

    Attributes:
        image: (H, W, 3) uint8.
        camera: where from.
    """

    image: np.ndarray
    camera: Camera

    def pixel(self, point: Sequence[float] | Array) -> tuple[float, float]:
        """Return the pixel (x, y) where a point (3,) of the world is seen."""
        height, width = self.image.shape[:2]
        x, y, z = self.camera.axes() @ (np.asarray(point) - self.camera.eye())
        scale = width / (2 * np.tan(np.deg2rad(self.camera.view) / 2)) / -z
        return width / 2 + scale * x, height / 2 - scale * y


def render(bodies: Sequence[Body], camera: Camera, size: tuple[int, int], seed: int = 0) -> Picture:
    """Take a picture of bodies.

    Args:
        bodies: what is there.
        camera: where from.
        size: width and height in pixels.
        seed: of the grain.
    """
    stage = _Stage(bodies, camera)
    width, height = size
    rng = np.random.default_rng(seed)
    rows = max(1, 2_000_000 // (width * SAMPLES**2))
    strips = [stage.strip(size, range(top, min(top + rows, height)), rng) for top in range(0, height, rows)]
    return Picture(np.round(255 * np.concatenate(strips)).astype(np.uint8), camera)


class _Stage:
    def __init__(self, bodies: Sequence[Body], camera: Camera) -> None:
        self.bodies, self.camera = bodies, camera
        corners = np.concatenate([body.corners for body in bodies])
        self.normals = np.concatenate([body.normals for body in bodies])
        self.owner = np.repeat(np.arange(len(bodies)), [len(body.corners) for body in bodies])
        self.tracer = EmbreeScene()
        TriangleMesh(self.tracer, corners.astype(np.float32))
        right, up, back = camera.axes()
        self.lamp = _unit(back - 0.75 * right + 0.9 * up + np.array([0.0, 0.0, 0.6]))

    def strip(self, size: tuple[int, int], rows: range, rng: np.random.Generator) -> Array:
        """Return some rows (rows, W, 3) of the picture, sRGB 0 to 1."""
        width, height = size
        n = SAMPLES
        grid = np.arange(n) / n
        y = (np.array(rows)[:, None] + grid).reshape(-1, 1)
        x = (np.arange(width)[:, None] + grid).reshape(1, -1)
        jitter = rng.random((2, y.size, x.size)) / n
        tangent = 2 * np.tan(np.deg2rad(self.camera.view) / 2) / width
        right, up, back = self.camera.axes()
        across = (x + jitter[0] - width / 2) * tangent
        upwards = (height / 2 - y - jitter[1]) * tangent
        direction = _unit((across[..., None] * right + upwards[..., None] * up - back).reshape(-1, 3))
        shape = (len(rows), n, width, n)
        chance = np.broadcast_to(rng.random((len(rows), 1, width, 1, 2)), (*shape, 2))
        turn = SKY_RAYS * rng.permutation(n * n).reshape(1, n, 1, n, 1)
        seeds = np.mod(chance + turn * EVEN, 1).reshape(-1, 2)
        light = self._trace(direction, seeds).reshape(*shape, 3).mean(axis=(1, 3))
        return _to_srgb(light)

    def _trace(self, direction: Array, seeds: Array) -> Array:
        """Return the light (n, 3) from directions (n, 3), with random numbers (n, 2) for each."""
        start = np.tile(self.camera.eye(), (len(direction), 1)).astype(np.float32)
        hit = self.tracer.run(start, direction.astype(np.float32), output=True)
        light = np.ones((len(direction), 3))
        seen = np.flatnonzero(hit["primID"] >= 0)
        triangle = hit["primID"][seen]
        u, v = hit["u"][seen, None], hit["v"][seen, None]
        point = self.camera.eye() + hit["tfar"][seen, None] * direction[seen]
        flat = _unit(hit["Ng"][seen].astype(float))
        flat *= -np.sign(np.sum(flat * direction[seen], axis=1, keepdims=True))
        a, b, c = np.moveaxis(self.normals[triangle], 1, 0)
        normal = _unit((1 - u - v) * a + u * b + v * c)
        # Normals of meshes point either way; those of the side that is seen point to the viewer.
        normal *= np.where(np.sum(normal * flat, axis=1, keepdims=True) < 0, -1.0, 1.0)
        key, sky = self._lit(point + HAIR * flat, normal, seeds[seen])
        towards = np.clip(-np.sum(normal * direction[seen], axis=1), 0, 1)
        shade = KEY * key + SKY * sky + HEADLIGHT * towards
        for k, body in enumerate(self.bodies):
            own = self.owner[triangle] == k
            if not own.any():
                continue
            if body.floor:
                level = KEY * self.lamp[2] + SKY + HEADLIGHT * towards[own]
                light[seen[own]] = np.clip(shade[own] / level, 0, 1)[:, None]
            else:
                light[seen[own]] = _to_linear(body.colors(point[own])) * shade[own, None]
        return light

    def _lit(self, point: Array, normal: Array, seeds: Array) -> tuple[Array, Array]:
        """Return the shares (n,) of the lamp's and of the sky's light that arrive at points."""
        side = _unit(np.cross(self.lamp, [0.0, 0.0, 1.0]))
        disc = np.sqrt(seeds[:, :1]) * _circle(seeds[:, 1])
        lamp = _unit(self.lamp + SOFTNESS * disc @ np.stack([side, np.cross(self.lamp, side)]))
        cosine = np.clip(np.sum(normal * lamp, axis=1), 0, 1)
        # A little more than the cosine: rounder, softer shapes.
        key = cosine**0.8 * ~self._blocked(point, lamp, 1e3)
        sky = np.zeros(len(point))
        for k in range(SKY_RAYS):
            u, v = np.mod(seeds + k * EVEN, 1).T
            ball = np.column_stack([2 * np.sqrt(u * (1 - u))[:, None] * _circle(v), 1 - 2 * u])
            sky += ~self._blocked(point, _unit(normal + ball), REACH)
        return key, sky / SKY_RAYS

    def _blocked(self, point: Array, ray: Array, reach: float) -> np.ndarray:
        limit = np.full(len(point), reach, dtype=np.float32)
        found = self.tracer.run(
            point.astype(np.float32), ray.astype(np.float32), dists=limit, query="OCCLUDED"
        )
        return found >= 0


def _circle(share: Array) -> Array:
    return np.stack([np.cos(2 * np.pi * share), np.sin(2 * np.pi * share)], axis=-1)


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1)


def _to_linear(color: Array) -> Array:
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)


def _to_srgb(light: Array) -> Array:
    light = np.clip(light, 0, 1)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
