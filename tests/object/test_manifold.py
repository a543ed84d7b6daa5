from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from symgrasp.errors import InputError, ProfileError
from symgrasp.object.manifold import Manifold, grasp_to_tool, turn_text, wrap
from symgrasp.object.profile import Profile
from symgrasp.poses import rotation_z, translation
from tests.strategies import angles, poses, profiles

BOTTLE = Profile([[0, 0.033], [0.15, 0.033], [0.20, 0.014], [0.24, 0.014]])


def test_cell_centres():
    m = Manifold(BOTTLE, 24, 48)
    assert m.h[0] == pytest.approx(0.005)
    assert m.h[-1] == pytest.approx(0.235)
    assert m.theta[0] == pytest.approx(-np.pi + np.pi / 48)
    assert m.theta[-1] == pytest.approx(np.pi - np.pi / 48)


@given(profiles(), angles, st.floats(0, 1))
def test_projection_inverts_contact(p, theta, share):
    """f(f⁻¹(x)) = x (equations 1 and 2)."""
    m = Manifold(p, 4, 8)
    h = p.h_min + share * (p.h_max - p.h_min)
    back_h, back_theta = m.project(m.contact(h, theta))
    assert back_h == pytest.approx(h)
    assert wrap(back_theta - theta) == pytest.approx(0.0, abs=1e-6)


def test_contact_by_the_paper_s_formula_in_batches():
    h, theta = np.meshgrid([0.01, 0.175], [-2.0, 0.0, 3.0], indexing="ij")
    points = Manifold(BOTTLE, 4, 8).contact(h, theta)
    for i, j in np.ndindex(2, 3):
        r = float(BOTTLE.radius(h[i, j]))
        expected = [r * np.cos(theta[i, j]), r * np.sin(theta[i, j]), h[i, j]]
        np.testing.assert_allclose(points[i, j], expected)


@given(st.integers(1, 40), st.integers(1, 90), st.data())
def test_cell_of_a_centre_is_that_cell(heights, columns, data):
    m = Manifold(BOTTLE, heights, columns)
    i, j = data.draw(st.integers(0, heights - 1)), data.draw(st.integers(0, columns - 1))
    h, theta = float(m.h[i]), float(m.theta[j])
    assert m.cell(h, theta) == (i, j)
    assert m.cell(h, theta + 2 * np.pi) == (i, j)


def test_cells_at_the_edges():
    m = Manifold(BOTTLE, 24, 48)
    assert m.cell(0.0, -np.pi) == (0, 0)
    assert m.cell(0.24, np.pi - 1e-9) == (23, 47)
    with pytest.raises(ProfileError):
        m.cell(-1e-6, 0.0)


@given(poses(), st.floats(0, 0.2), angles, st.sampled_from([0.0, np.pi]), st.floats(0, 0.1))
def test_tool_pose_by_its_definition(T, h, theta, roll, d):
    """T_world_object · Rz(θ) · Trans(d, 0, h) · R_hand(roll), with the hand's axes written out."""
    tool = grasp_to_tool(T, h, theta, roll, d)
    frame = T @ rotation_z(theta) @ translation([d, 0, h])
    side = 1.0 if roll == 0 else -1.0
    np.testing.assert_allclose(tool[:3, 3], frame[:3, 3], atol=1e-8)
    np.testing.assert_allclose(tool[:3, 2], -frame[:3, 0], atol=1e-8)  # approach: radially inwards
    np.testing.assert_allclose(tool[:3, 1], side * frame[:3, 1], atol=1e-8)  # closing: tangent
    np.testing.assert_allclose(np.cross(tool[:3, 1], tool[:3, 2]), tool[:3, 0], atol=1e-8)


@given(poses(), st.integers(-100, 100))
def test_turning_the_object_shifts_the_tool_poses_bit_for_bit(T, k):
    """Equation 3, before any robot: the same cells, rolled."""
    m = Manifold(BOTTLE, 3, 24)
    turned = m.tool_poses(T @ rotation_z(k * m.dtheta), 0.02)
    assert np.array_equal(turned, np.roll(m.tool_poses(T, 0.02), -k, axis=2))


@given(poses(), angles)
def test_any_turn_is_a_shift_of_the_grid(T, delta):
    m = Manifold(BOTTLE, 3, 24)
    shifted, k = m.shift(delta)
    assert abs(shifted.theta_start - m.theta_start) <= 0.5 * m.dtheta + 1e-9
    turned = shifted.tool_poses(T @ rotation_z(delta), 0.02)
    np.testing.assert_allclose(turned, np.roll(m.tool_poses(T, 0.02), -k, axis=2), atol=1e-8)


def test_standoff_keeps_the_palm_outside():
    m = Manifold(Profile([[0, 0.02], [0.1, 0.06]]), 10, 4)
    tools = m.tool_poses(np.eye(4), finger_depth=0.035)
    distance = np.hypot(tools[0, :, 0, 0, 3], tools[0, :, 0, 1, 3])
    np.testing.assert_allclose(distance, np.maximum(0, m.profile.radius(m.h) - 0.035), atol=1e-12)


@pytest.mark.parametrize(("heights", "columns"), [(0, 4), (4, 0)])
def test_a_grid_needs_cells(heights, columns):
    with pytest.raises(InputError, match="at least 1"):
        Manifold(BOTTLE, heights, columns)


@pytest.mark.parametrize(
    ("degrees", "text"),
    [(0.0, "0.00°"), (-0.004, "0.00°"), (37.5, "37.50°"), (-7.26, "-7.26°"), (-180.0, "-180.00°")],
)
def test_a_turn_is_written_with_two_decimals(degrees, text):
    assert turn_text(np.deg2rad(degrees)) == text
