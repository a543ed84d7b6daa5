from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.spatial import ConvexHull

from symgrasp.errors import ProfileError
from symgrasp.object.profile import COLLISION_FACETS, MOST_KNOTS, Profile
from tests.strategies import profiles

BOTTLE = [[0, 0.033], [0.15, 0.033], [0.20, 0.014], [0.24, 0.014]]


def test_radius_is_linear_between_knots():
    p = Profile(BOTTLE)
    assert (p.h_min, p.h_max, p.r_max) == (0.0, 0.24, 0.033)
    assert p.radius(0.175) == pytest.approx(0.5 * (0.033 + 0.014))
    assert p.radius(np.array([[0.0, 0.24]])).shape == (1, 2)


@pytest.mark.parametrize(
    ("points", "field"),
    [
        ([[0, -0.1], [1, 0.1]], "profile[0]"),
        ([[0, 0.1], [1, 0.1], [0.5, 0.1]], "profile[2]"),
        ([[0, 0.1], [0, 0.2]], "profile[1]"),
        ([[0, float("nan")], [1, 0.1]], "profile[0]"),
        ([[0, 0.1], [float("inf"), 0.1]], "profile[1]"),
        ([[0, 0], [1, 0]], "profile"),
        ([[0, 0.1]], "profile"),
        ("abc", "profile"),
        ([[0, 1, 2], [1, 1, 1]], "profile"),
        (np.ones((MOST_KNOTS + 1, 2)), "profile"),
        ([["no number"]] * 1_000_000, "profile"),
    ],
)
def test_bad_profiles_name_the_knot(points, field):
    with pytest.raises(ProfileError) as caught:
        Profile(points, "bottle.yaml")
    assert caught.value.field == field
    assert str(caught.value).startswith(f"bottle.yaml: {field}: ")


@pytest.mark.parametrize("h", [-1e-9, 0.2401, float("nan")])
def test_heights_outside_are_errors(h):
    with pytest.raises(ProfileError, match="height"):
        Profile(BOTTLE).radius(h)


def test_points_are_copied_and_read_only():
    points = np.array(BOTTLE)
    p = Profile(points)
    points[0, 1] = 9.0
    assert p.radius(0.0) == 0.033
    with pytest.raises(ValueError, match="read-only"):
        p.points[0, 0] = 1.0


@given(profiles())
@settings(max_examples=40, deadline=None)
def test_convex_pieces_are_the_solid(p):
    """Every piece is convex; together they have the volume of the solid with polygons for circles."""
    pieces = p.convex_pieces()
    h, r = p.points.T
    frusta = np.pi / 3 * np.diff(h) * (r[1:] ** 2 + r[1:] * r[:-1] + r[:-1] ** 2)
    polygon = COLLISION_FACETS / np.pi * np.tan(np.pi / COLLISION_FACETS)  # circumscribed over circle
    assert sum(ConvexHull(v).volume for v in pieces) == pytest.approx(frusta.sum() * polygon, rel=1e-9)


@given(profiles())
@settings(max_examples=40, deadline=None)
def test_pieces_contain_the_surface(p):
    hulls = [ConvexHull(v).equations for v in p.convex_pieces()]
    heights = np.linspace(p.h_min, p.h_max, 50)
    turns = np.linspace(0, 2 * np.pi, 37)
    r = p.radius(heights)[:, None]
    surface = np.stack(
        np.broadcast_arrays(r * np.cos(turns), r * np.sin(turns), heights[:, None]), -1
    ).reshape(-1, 3)
    signed = np.min([(surface @ e[:, :3].T + e[:, 3]).max(axis=1) for e in hulls], axis=0)
    assert signed.max() < 1e-9


@given(profiles())
@settings(max_examples=40, deadline=None)
def test_mesh_has_the_solid_s_volume(p):
    mesh = p.mesh(facets=256)
    h, r = p.points.T
    frusta = np.pi / 3 * np.diff(h) * (r[1:] ** 2 + r[1:] * r[:-1] + r[:-1] ** 2)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(frusta.sum(), rel=1e-3)


def test_pointed_ends_have_no_degenerate_pieces():
    cone = Profile([[0, 0.0], [0.1, 0.05], [0.2, 0.0]])
    assert len(cone.convex_pieces()) == 1
    assert cone.mesh().is_watertight


def test_radius_span():
    p = Profile(BOTTLE)
    assert p.radius_span(-1.0, 0.16) == pytest.approx((0.0292, 0.033))
    assert p.radius_span(0.14, 0.23) == pytest.approx((0.014, 0.033))
