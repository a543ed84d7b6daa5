"""Scenes at random, as the content of scene files: what fails can be saved and looked at."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml

from symgrasp.files import SCENES_DIR
from symgrasp.object.profile import Profile
from symgrasp.poses import Array, from_position_rpy
from symgrasp.robot.hand import HANDS

__all__ = ["BASES", "KINDS", "random_scene", "scene_of_kind"]

BASES = ("bottle_on_table", "soda_can", "log_iiwa_and_panda", "handover_between_robots", "log_four_robots")
"""Shipped scenes whose robots are used."""

MOUNTABLE = tuple(name for name, hand in HANDS.items() if hand.urdf)

WAISTS = (0.0, 1e-9, 1e-6, 1e-3, 4e-3)
"""Radii (m) of the thinnest place of an object with a waist: a hand reaches it, or nothing does."""

THIN = 0.045
"""Radius (m) that some hands reach around."""

MESH_ENDINGS = ("stl", "ply", "obj", "off", "glb")


def random_scene(seed: int, robots: Sequence[Mapping[str, Any]] = ()) -> dict[str, Any]:
    """Return a scene with a small grid; robots reach the object mostly, and things are in the way.

    Bases are tilted every other time, hands that can be mounted are drawn, and the object has a few knots.

    Args:
        seed: of everything in it.
        robots: its robots, the first without a name; by default those of one of `BASES`.
    """
    rng = np.random.default_rng(seed)
    content = yaml.safe_load((SCENES_DIR / f"{rng.choice(BASES[:1] if robots else BASES)}.yaml").read_text())
    if robots:
        name = content["robots"][0]["name"]
        content["robots"] = [{"name": name, **robot} for robot in robots]
    content["name"], content["description"] = f"random_{seed}", "Drawn at random"
    for robot in content["robots"]:
        base = robot.setdefault("base", {"position": [0, 0, 0]})
        base["position"] = (np.array(base["position"]) + rng.normal(0, 0.08, 3)).round(4).tolist()
        turn = np.array(base.pop("rpy_deg", [0, 0, 0])) + rng.normal(0, 12, 3) * rng.choice([0, 1])
        base["rpy_deg"] = turn.round(3).tolist()
        if "mount" in robot:
            robot["hand"] = str(rng.choice(MOUNTABLE))
    content["object"] = {"name": "thing", "profile": _few_knots(rng)}
    for task in content["tasks"]:
        pose = task["pose"]
        pose["position"] = (np.array(pose["position"]) + rng.normal(0, 0.1, 3)).round(4).tolist()
        turn = np.array(pose.pop("rpy_deg", [0, 0, 0])) + rng.normal(0, 40, 3) * rng.choice([0, 1])
        pose["rpy_deg"] = turn.round(3).tolist()
    centre = np.array(content["tasks"][0]["pose"]["position"])
    content["obstacles"] = [_obstacle(rng, k, centre) for k in range(rng.integers(0, 7))]
    content["map"] = {
        "heights": int(rng.integers(2, 6)),
        "angles": int(rng.integers(4, 9)),
        "redundancy": int(rng.integers(2, 8)),
        "margin": float(rng.choice([0.0, 0.0, 0.005, 0.02])),
        "approach": float(rng.choice([0.0, 0.0, 0.03, 0.1])),
    }
    return content


def scene_of_kind(kind: str, seed: int, folder: Path) -> dict[str, Any]:
    """Return a scene like those of `random_scene` with an object or obstacles of a kind.

    Args:
        kind: one of `KINDS`.
        seed: of everything in it.
        folder: where files of meshes are written.
    """
    content = random_scene(seed)
    content["name"] = f"{kind}_{seed}"
    rng = np.random.default_rng([seed, list(KINDS).index(kind)])
    KINDS[kind](content, rng, folder)
    return content


def _among_meshes(content: dict[str, Any], rng: np.random.Generator, folder: Path) -> None:
    """Make obstacles of meshes, convex and hollow, and every other time measure the object from one."""
    folder.mkdir(parents=True, exist_ok=True)
    centre = np.array(content["tasks"][0]["pose"]["position"])
    content["obstacles"] = []
    for k in range(rng.integers(1, 5)):
        obstacle = _obstacle(rng, k, centre)
        for shape in ("box", "cylinder", "sphere"):
            obstacle.pop(shape, None)
        path = folder / f"{content['name']}_{k}.{rng.choice(MESH_ENDINGS)}"
        _mesh(rng).export(path)
        content["obstacles"].append({**obstacle, "mesh": str(path)})
    if rng.choice([0, 1]):
        path = folder / f"{content['name']}_object.stl"
        mesh = Profile(content["object"]["profile"]).mesh()
        mesh.apply_transform(from_position_rpy(rng.normal(0, 0.1, 3), rng.uniform(-np.pi, np.pi, 3)))
        mesh.export(path)
        content["object"] = {"name": "thing", "mesh": str(path)}


def _with_cusps(content: dict[str, Any], rng: np.random.Generator, folder: Path) -> None:
    """Make the radius zero somewhere, or nearly: the tip of a cone, the poles of a ball, a waist."""
    height, radius = rng.uniform(0.08, 0.5), rng.uniform(0.015, 0.045)
    polar = np.linspace(0, np.pi, 2 * rng.integers(2, 12) + 1)
    waist = float(rng.choice(WAISTS))
    knots = [
        [[0.0, radius], [height, 0.0]],
        [[0.0, 0.0], [height, radius]],
        [[0.0, 0.0], [height * rng.uniform(0.2, 0.8), radius], [height, 0.0]],
        np.column_stack([radius * (1 - np.cos(polar)), radius * np.abs(np.sin(polar)).round(12)]),
        [[0.0, radius], [height / 2, waist], [height, radius]],
        [[0.0, radius], [height / 3, waist], [height * 2 / 3, waist], [height, radius]],
    ][rng.integers(6)]
    content["object"] = {"name": "thing", "profile": np.array(knots).tolist()}
    content["map"]["heights"] = int(rng.choice([3, 5, 9]))  # uneven: one row is at the waist


def _very_long(content: dict[str, Any], rng: np.random.Generator, folder: Path) -> None:
    """Make the object one to three metres long; arms reach a part of it."""
    heights = np.linspace(0, rng.uniform(1.0, 3.0), rng.integers(2, 7))
    radii = rng.uniform(0.006, 0.042) + rng.uniform(-0.005, 0.005, len(heights))
    _lay(content, np.column_stack([heights, radii]), rng)


def _very_fat(content: dict[str, Any], rng: np.random.Generator, folder: Path) -> None:
    """Make the object wider than any hand opens: a drum, with a knob on it or without, or two on an axle."""
    width, height, thin = rng.uniform(0.1, 0.4), rng.uniform(0.1, 0.9), rng.uniform(0.008, 0.035)
    drum, length = [[0.0, width], [height, width]], rng.uniform(0.15, 0.5)
    knob = [[height + 1e-5, thin], [height + length, thin]]
    head = [[height + length + 1e-5, width], [height + 2 * length, width]]
    _lay(content, [drum, [*drum, *knob], [*drum, *knob, *head]][rng.integers(3)], rng)


def _plate(content: dict[str, Any], rng: np.random.Generator, folder: Path) -> None:
    """Make the object flat: a plate, with a stem or between two, or a thin disc as small as a coin."""
    width, thick, thin = rng.uniform(0.08, 0.25), rng.uniform(0.002, 0.02), rng.uniform(0.004, 0.03)
    plate, length = [[0.0, width], [thick, width]], rng.uniform(0.05, 0.4)
    stem = [[thick + 1e-5, thin], [thick + length, thin]]
    below = [[-length, thin], [-1e-5, thin]]
    coin = [[0.0, thin], [thick, thin]]
    _lay(content, [plate, [*plate, *stem], [*below, *plate, *stem], coin][rng.integers(4)], rng)


KINDS: dict[str, Callable[[dict[str, Any], np.random.Generator, Path], None]] = {
    "meshes": _among_meshes,
    "cusps": _with_cusps,
    "long": _very_long,
    "fat": _very_fat,
    "plates": _plate,
}
"""What makes a random scene one of a kind."""


def _lay(content: dict[str, Any], knots: Any, rng: np.random.Generator) -> None:
    """Give the object a profile: thin, if it is anywhere, where its bottom was in each task."""
    knots = np.array(knots, dtype=float).round(5)
    heights = np.linspace(knots[0, 0], knots[-1, 0], 400)
    thin = heights[np.interp(heights, *knots.T) < THIN]
    content["object"] = {"name": "thing", "profile": knots.tolist()}
    content["map"]["heights"] = int(rng.integers(4, 10))
    for task in content["tasks"]:
        pose = task["pose"]
        place = from_position_rpy(pose["position"], np.deg2rad(pose["rpy_deg"]))
        at = rng.choice(thin if len(thin) else heights)
        pose["position"] = (place[:3, 3] - at * place[:3, 2]).round(4).tolist()


def _few_knots(rng: np.random.Generator) -> list[list[float]]:
    heights = np.linspace(0, rng.uniform(0.08, 0.5), rng.integers(2, 6))
    radii = rng.uniform(0.012, 0.045, len(heights))
    return np.column_stack([heights, radii]).round(4).tolist()


def _obstacle(rng: np.random.Generator, k: int, centre: Array) -> dict[str, Any]:
    shapes: list[Callable[[], dict[str, Any]]] = [
        lambda: {"box": rng.uniform(0.02, 0.5, 3).round(4).tolist()},
        lambda: {
            "cylinder": {
                "radius": round(rng.uniform(0.01, 0.15), 4),
                "height": round(rng.uniform(0.05, 0.6), 4),
            }
        },
        lambda: {"sphere": {"radius": round(rng.uniform(0.02, 0.15), 4)}},
    ]
    pose = {
        "position": (centre + rng.normal(0, 0.25, 3)).round(4).tolist(),
        "rpy_deg": rng.uniform(-180, 180, 3).round(3).tolist(),
    }
    return {"name": f"obstacle{k}", **shapes[rng.integers(len(shapes))](), "pose": pose}


def _mesh(rng: np.random.Generator) -> trimesh.Trimesh:
    """Return a mesh up to some 0.3 m large: one of three convex, three hollow and one open."""
    width, height, thick = rng.uniform(0.05, 0.15), rng.uniform(0.05, 0.3), rng.uniform(0.004, 0.03)
    creation = trimesh.creation
    bowl = [[0, 0], [width, 0], [width, height], [width - thick, height], [width - thick, thick], [0, thick]]
    shapes: list[Callable[[], trimesh.Trimesh]] = [
        lambda: creation.icosphere(subdivisions=1, radius=width),
        lambda: trimesh.convex.convex_hull(rng.normal(0, width / 2, (12, 3))),
        lambda: creation.capsule(height=height, radius=thick, count=[8, 8]),
        lambda: creation.annulus(width - thick, width, height, sections=16),
        lambda: creation.torus(width, thick, major_sections=14, minor_sections=8),
        lambda: creation.revolve(np.array(bowl), sections=16),
        lambda: creation.revolve(np.array([[width, 0], [width, height]]), sections=16),
    ]
    return shapes[rng.integers(len(shapes))]()
