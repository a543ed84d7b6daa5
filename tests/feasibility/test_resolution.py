"""To which resolution the redundancy of infeasible cells is searched, for each way in which cells fail."""

from typing import Any

import numpy as np
import pytest
import yaml

from symgrasp.bench.maps.random_scenes import scene_of_kind
from symgrasp.engine.redundancy.cover import FINEST
from symgrasp.feasibility.create import MapMaker
from symgrasp.feasibility.map import FeasibilityMap
from symgrasp.files import SCENES_DIR
from symgrasp.reason import Reason
from symgrasp.scene.format import MOST_SAMPLES
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world


def searched(scene: Scene, samples: int | str = "auto") -> FeasibilityMap:
    with open_world(scene.with_settings(redundancy=samples)) as world:
        return MapMaker(world).map()


def bottle(**changes: Any) -> Scene:
    """The shipped bottle on a table on a small grid, with other settings or parts of the robot."""
    content = yaml.safe_load((SCENES_DIR / "bottle_on_table.yaml").read_text())
    content["map"] |= {"heights": 3, "angles": 10, **changes.pop("map", {})}
    content["robots"][0] |= changes.pop("robot", {})
    content["obstacles"] += changes.pop("obstacles", [])
    return Scene.from_content(content)


BALL = {"name": "ball", "sphere": {"radius": 0.0982}, "pose": {"position": [0.0485, -0.0923, -0.0068]}}
BESIDE_IT = {"position": [0.0622, 0.0772, -0.0866], "rpy_deg": [10.404, -2.018, -2.276]}
"""Where the first link is 3 to 5 mm away from the ball, at whatever angle its joint is."""

FEET = [[0.15, 0.15], [-0.15, 0.15], [-0.15, -0.15], [0.15, -0.15]]


@pytest.mark.parametrize(
    ("scene", "reason"),
    [
        (bottle(), Reason.SCENE_COLLISION),
        (bottle(map={"approach": 0.1}), Reason.APPROACH_BLOCKED),
        (bottle(robot={"support": FEET}), Reason.OUT_OF_BALANCE),
        (bottle(map={"margin": 0.005}, robot={"base": BESIDE_IT}, obstacles=[BALL]), Reason.SCENE_COLLISION),
    ],
    ids=["collisions", "retreat", "balance", "margin"],
)
def test_it_is_at_least_the_one_that_is_stated(scene, reason):
    m = searched(scene)
    assert (m.reason[~m.proven] == reason).any()
    assert 0.0 < m.resolution <= FINEST
    dense = searched(scene, MOST_SAMPLES)
    assert not (dense.feasible & ~m.feasible).any()
    assert np.isfinite(m.q[m.feasible]).all()


def test_where_pybullet_alone_decides_it_is_asked_all_over_the_range(tmp_path):
    """Beside a drum 0.8 m thick, whose facets PyBullet takes for its surface, thousands of values are its."""
    scene = Scene.from_content(scene_of_kind("fat", 406, tmp_path)).with_settings(heights=12, angles=24)
    cell = 1, 7, 4
    only = np.zeros((2, 12, 24), dtype=bool)
    only[cell] = True
    found: list[FeasibilityMap] = []
    for samples in ("auto", MOST_SAMPLES):
        with open_world(scene.with_settings(redundancy=samples)) as world:
            found.append(MapMaker(world).map("north west", only=only))
    assert [m.feasible[cell] for m in found] == [True, True]
    assert found[0].resolution > FINEST
