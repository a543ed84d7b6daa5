from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure

from symgrasp.errors import MeshError, ProfileError
from symgrasp.feasibility.fit import fit
from symgrasp.feasibility.object_report import STEP, describe_object, holding_heights
from symgrasp.feasibility.pictures import to_png
from symgrasp.object.library import library_objects, load_object
from symgrasp.object.profile import Profile
from symgrasp.robot.hand import HANDS

# Height and largest diameter in millimetres, as anybody can measure them.
SIZES = {
    "broom_stick": (1300, 24),
    "can_330ml": (115, 66),
    "jam_jar": (119, 74),
    "log_70mm": (500, 70),
    "pet_bottle_500ml": (217, 65),
    "rolling_pin": (430, 60),
    "tennis_ball": (67, 67),
    "tumbler": (120, 76),
    "wine_bottle": (300, 76),
    "wine_glass": (155, 65),
}


def volume(profile: Profile) -> float:
    """Volume (m³) as a sum of frustums."""
    (h, r) = profile.points.T
    return float(np.sum(np.pi / 3 * np.diff(h) * (r[:-1] ** 2 + r[:-1] * r[1:] + r[1:] ** 2)))


def test_the_library_is_complete():
    assert list(library_objects()) == sorted(SIZES)


@pytest.mark.parametrize("name", SIZES)
def test_objects_have_their_real_size(name):
    label, profile = load_object(name)
    assert label == name
    assert 1e3 * profile.h_max == pytest.approx(SIZES[name][0], abs=0.6)
    assert 2e3 * profile.r_max == pytest.approx(SIZES[name][1], abs=0.6)
    assert profile.h_min == 0.0
    assert library_objects()[name].read_text().startswith("# ")


@pytest.mark.parametrize(
    ("name", "content"),
    [("can_330ml", 330e-6), ("pet_bottle_500ml", 500e-6), ("wine_bottle", 750e-6), ("jam_jar", 380e-6)],
)
def test_vessels_are_a_little_larger_than_what_they_hold(name, content):
    assert 1.0 < volume(load_object(name)[1]) / content < 1.6


@pytest.mark.parametrize("name", SIZES)
def test_library_objects_are_found_again_in_their_meshes(tmp_path, name):
    profile = load_object(name)[1]
    mesh = profile.mesh(facets=48)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.1, [1, 0, 0], [0.2, 0.1, 0]))
    mesh.export(tmp_path / f"{name}.stl")
    label, found = load_object(tmp_path / f"{name}.stl")
    assert label == name
    assert found.h_max == pytest.approx(profile.h_max, abs=1e-4)
    # Steps of a tenth of a millimetre in height are as steep as can be; look beside them.
    h = np.linspace(0, min(profile.h_max, found.h_max), 997)
    low, high = np.transpose([profile.radius_span(x - 2e-4, x + 2e-4) for x in h])
    assert (found.radius(h) > low - 2e-4).all()
    assert (found.radius(h) < high + 2e-4).all()


@pytest.mark.parametrize("name", ["can_330ml", "wine_glass", "rolling_pin"])
def test_hands_hold_exactly_where_they_fit(name):
    report = describe_object(name)
    assert set(report.holds) == set(HANDS)
    rng = np.random.default_rng(0)
    for hand_name, intervals in report.holds.items():
        assert intervals
        for h in rng.uniform(report.profile.h_min, report.profile.h_max, 200):
            edges = np.ravel(intervals)
            if np.abs(edges - h).min() > STEP:
                inside = any(low <= h <= high for low, high in intervals)
                assert inside == (fit(HANDS[hand_name], report.profile, float(h)) is None)


def test_a_log_too_thick_is_held_nowhere():
    assert holding_heights(HANDS["franka"], Profile([[0, 0.06], [0.5, 0.06]])) == ()
    assert holding_heights(HANDS["franka"], Profile([[0, 0.03], [0.005, 0.03]])) == ()


def test_a_mesh_is_reported_with_its_measurement(tmp_path):
    mesh = trimesh.creation.cylinder(30, 100, sections=64)
    mesh.export(tmp_path / "roll.stl")
    report = describe_object(tmp_path / "roll.stl", scale=0.001)
    assert report.name == "roll"
    assert report.measurement is not None
    assert report.profile.points == pytest.approx(report.measurement.points)
    assert report.profile.T_mesh_object == pytest.approx(report.measurement.T_mesh_object)
    assert describe_object("can_330ml").measurement is None
    with pytest.raises(MeshError, match=r"; scale .* would make it"):
        describe_object(tmp_path / "roll.stl")


def test_pictures_show_profile_and_deviation(tmp_path):
    trimesh.creation.cylinder(0.03, 0.1, sections=64).export(tmp_path / "roll.stl")
    measured, listed = describe_object(tmp_path / "roll.stl").plot(), describe_object("can_330ml").plot()
    assert isinstance(measured, Figure)
    assert [len(figure.axes) for figure in (measured, listed)] == [3, 1]  # with the colour bar
    assert to_png(measured).startswith(b"\x89PNG")
    outline = listed.axes[0].lines[0]
    assert np.max(outline.get_xdata()) == pytest.approx(33.1)  # type: ignore[reportArgumentType]


def write(folder: Path, text: str) -> Path:
    path = folder / "object.yaml"
    path.write_text(text)
    return path


def test_objects_from_yaml(tmp_path):
    name, profile = load_object(write(tmp_path, "name: stick\nprofile: [[0, 0.01], [0.5, 0.01]]\n"))
    assert (name, profile.h_max, profile.r_max) == ("stick", 0.5, 0.01)


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("[1, 2]", "file"),
        ("name: [", "file"),
        ("profile: [[0, 1], [1, 1]]", "name"),
        ("name: ''\nprofile: [[0, 1], [1, 1]]", "name"),
        ("name: a", "profile"),
        ("name: a\nprofile: 3", "profile"),
        ("name: a\nprofile: [[0, 1], [0, 1]]", "profile[1]"),
        ("name: a\nprofil: [[0, 1], [1, 1]]", "profil"),
    ],
)
def test_bad_yaml_names_the_field(tmp_path, text, field):
    path = write(tmp_path, text)
    with pytest.raises(ProfileError) as caught:
        load_object(path)
    assert caught.value.field == field
    assert str(caught.value).startswith(str(path))


def test_unknown_objects_list_the_library(tmp_path):
    with pytest.raises(ProfileError, match="did you mean 'wine_glass'"):
        load_object("wine_glas")
    with pytest.raises(ProfileError, match="can be read"):
        load_object(tmp_path / "none.yaml")
