"""The pictures in docs/ show what they say: the ray tracer, and the paint on objects."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from docs.figures.__main__ import FIGURES, main
from docs.figures.models import cells_paint, floor, object_body
from docs.figures.render import Body, Camera, render
from symgrasp.object.manifold import Manifold
from symgrasp.object.profile import Profile
from symgrasp.poses import from_position_rpy

SIZE = (120, 90)
CAMERA = Camera((0.1, 0.2, 0.3), 35, 25, 1.0)
GREEN = np.array([44, 162, 95]) / 255


def ball(center: tuple[float, float, float], radius: float) -> Body:
    mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    mesh.apply_translation(center)
    return Body(mesh.triangles, mesh.vertex_normals[mesh.faces], GREEN)


def test_a_point_is_seen_where_the_picture_says():
    center = (0.3, 0.1, 0.4)
    picture = render([ball(center, 0.05)], CAMERA, SIZE)
    y, x = np.nonzero(picture.image.min(axis=-1) < 200)
    assert (x.mean() + 0.5, y.mean() + 0.5) == pytest.approx(picture.pixel(center), abs=0.6)
    # Its outline is as far from the middle as the width of the view says.
    distance = np.linalg.norm(CAMERA.eye() - center)
    across = 2 * distance * np.tan(np.deg2rad(CAMERA.view) / 2)
    assert np.ptp(x) + 1 == pytest.approx(0.1 / across * SIZE[0], abs=2)


def test_colours_are_those_of_the_legend_in_full_light():
    picture = render([ball((0.1, 0.2, 0.3), 0.4)], CAMERA, SIZE)
    ratio = picture.image[40:50, 55:65].mean(axis=(0, 1)) / (255 * GREEN)
    assert ratio == pytest.approx([1, 1, 1], abs=0.1)


def test_things_throw_shadows_on_white_paper():
    bare = render([floor(0)], CAMERA, SIZE).image
    assert bare.min() >= 254
    shaded = render([floor(0), ball((0.1, 0.2, 0.1), 0.1)], CAMERA, SIZE).image
    gray = (np.ptp(shaded.astype(int), axis=-1) < 3) & (shaded[..., 0] < 220)
    assert 0.005 < gray.mean() < 0.2


def test_cells_are_painted_where_their_centres_are():
    profile = Profile([[0, 0.03], [0.1, 0.03], [0.2, 0.01]])
    grid = Manifold(profile, 5, 8, theta_start=-3.0)
    colors = np.random.default_rng(0).random((5, 8, 3))
    pose = from_position_rpy([0.3, -0.2, 0.5], [0.4, 1.0, -2.0])
    h, theta = np.meshgrid(grid.h, grid.theta, indexing="ij")
    points = grid.contact(h, theta).reshape(-1, 3) @ pose[:3, :3].T + pose[:3, 3]
    body = object_body(profile, pose, cells_paint(grid, colors))
    assert np.allclose(body.colors(points), colors.reshape(-1, 3))


def test_an_unknown_figure_is_named(capsys):
    assert main(["nonsense"]) == 2
    assert "nonsense" in capsys.readouterr().err
    assert all(name in FIGURES for name in ("page", "soda_can"))
