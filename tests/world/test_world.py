from __future__ import annotations

from dataclasses import replace

import numpy as np
import pybullet
import pytest
import trimesh

from symgrasp.errors import SceneError
from symgrasp.poses import from_position_rpy, rotation_z, translation
from symgrasp.reason import Reason
from symgrasp.scene.scene import Scene
from symgrasp.scene.shipped import shipped_scenes
from symgrasp.world import BulletWorld, check_tasks
from tests.conftest import load_small, write_scene
from tests.world.link_pose import link_pose


def names(collisions):
    return {frozenset((str(c.a), str(c.b))) for c in collisions}


def test_links_are_where_forward_kinematics_puts_them():
    scene = load_small("log_two_robots")
    with BulletWorld(scene) as world:
        for arm in scene.arms.values():
            q = np.random.default_rng(0).uniform(arm.lower, arm.upper)
            world.set_arm(arm, q, 0.05)
            links = arm.robot.model.forward(arm.robot_values(q, 0.05))
            for link, pose in zip(arm.robot.model.link_names, links, strict=True):
                here = link_pose(world, arm.robot.name, link)
                np.testing.assert_allclose(here, arm.robot.T_world_base @ pose, atol=1e-6)


def test_distances_are_those_of_the_shapes(content, tmp_path):
    """A bottle beside a box, a cylinder, a ball and a mesh, at distances known by hand."""
    ball = trimesh.creation.box((0.1, 0.1, 0.1))
    ball.export(tmp_path / "cube.stl")
    content["object"]["profile"] = [[0, 0.05], [0.2, 0.05]]
    content["obstacles"] = [
        {"name": "box", "box": [0.1, 0.2, 0.2], "pose": {"position": [0.115, 0, 0]}},
        {
            "name": "cylinder",
            "cylinder": {"radius": 0.02, "height": 0.5},
            "pose": {"position": [-0.08, 0, 0]},
        },
        {"name": "ball", "sphere": {"radius": 0.03}, "pose": {"position": [0, 0.09, 0.1]}},
        {"name": "mesh", "mesh": "cube.stl", "pose": {"position": [0, -0.12, 0.1]}},
    ]
    content["tasks"][0]["pose"] = {"position": [0, 0, 0]}
    scene = Scene.load(write_scene(tmp_path, content))
    gaps = {"box": 0.015, "cylinder": 0.01, "ball": 0.01, "mesh": 0.02}
    with BulletWorld(scene) as world:
        found = {c.b.body: 0.05 - c.depth for c in reversed(world.object_contacts(0.05))}
        for name, gap in gaps.items():
            assert found[name] == pytest.approx(gap, abs=2e-4), name  # the body exceeds the object by 0.22 %


def test_a_hollow_mesh_stays_hollow(content, tmp_path):
    bowl = {"name": "bowl", "mesh": "package://static_scenes/bowl.obj", "pose": {"position": [0.4, 0, 0]}}
    content["obstacles"] = [bowl]
    content["object"]["profile"] = [[0, 0.02], [0.1, 0.02]]
    content["tasks"][0]["pose"] = {"position": [0.4, 0, 0.01]}
    scene = Scene.load(write_scene(tmp_path, content))
    with BulletWorld(scene) as world:
        assert not world.object_contacts()
        world.set_object(translation([0.44, 0, 0.01]))  # into the wall
        assert names(world.object_contacts()) == {frozenset(("bottle", "bowl"))}


def test_a_urdf_obstacle_collides(content, tmp_path):
    reference = "package://pybullet_data/table/table.urdf"
    content["obstacles"] = [{"name": "desk", "urdf": reference, "pose": {"position": [0.5, 0, -0.6]}}]
    content["tasks"][0]["pose"] = {"position": [0.5, 0, 0.1]}
    scene = Scene.load(write_scene(tmp_path, content))
    with BulletWorld(scene) as world:
        assert not world.object_contacts()
        world.set_object(translation([0.5, 0, -0.02]))
        assert {str(c.b) for c in world.object_contacts()} == {"desk/baseLink"}


def test_the_object_is_placed_by_its_axis_alone():
    scene = load_small("bottle_on_table")
    T = from_position_rpy([0.55, 0.05, 0.0], [0.4, 0.2, 0.1])
    with BulletWorld(scene) as world:
        depths = []
        for delta in (0.0, 0.05, 1.0, 3.0):
            world.set_object(T @ rotation_z(delta))
            depths.append([(c.b, c.depth) for c in world.object_contacts()])
        assert depths[0]
        assert all(d == depths[0] for d in depths)


def test_home_is_free_and_known_collisions_are_named():
    scene = load_small("bottle_on_table")
    arm = scene.arm()
    with BulletWorld(scene) as world:
        world.set_arm(arm, arm.home, 0.08)
        assert world.first_collision(arm) is None
        world.set_arm(arm, [0.8, 1.8, 0, -0.3, 0, 1.5, 0.8], 0.08)  # the arm flat on the table
        hit = world.first_collision(arm)
        assert hit is not None
        assert hit.reason == Reason.SCENE_COLLISION
        assert hit.b.body == "table"
        assert hit.depth > 0


def test_touch_links_may_touch_the_object_only():
    scene = load_small("bottle_on_table")
    arm = scene.arm()
    with BulletWorld(scene) as world:
        world.set_arm(arm, arm.home, 0.08)
        tip = link_pose(world, "panda", "panda_leftfinger") @ translation([0, 0.005, 0.045])
        world.set_object(tip)  # the bottle's foot is inside the finger
        assert world.first_collision(arm) is None
        world.set_object(link_pose(world, "panda", "panda_hand"))
        hit = world.first_collision(arm)
        assert hit is not None
        assert (hit.reason, hit.a.link) == (Reason.OBJECT_COLLISION, "panda_hand")


def test_flange_and_hand_overlap_always_and_are_allowed():
    scene = load_small("soda_can")
    arm = scene.arm()
    rng = np.random.default_rng(5)
    with BulletWorld(scene) as world:
        for q in rng.uniform(arm.lower, arm.upper, (300, 7)):
            world.set_arm(arm, q, 0.05)
            for c in world.collisions([arm]):
                assert {c.a.link, c.b.link} != {"panda_link7", "panda_hand"}


def test_self_collision_is_found():
    scene = load_small("soda_can")
    arm = scene.arm()
    with BulletWorld(scene) as world:
        world.set_arm(arm, [0, -1.7, 0, -3.1, 0, 0.3, 0], 0.05)
        hit = world.first_collision(arm)
        assert hit is not None
        assert hit.reason == Reason.SELF_COLLISION


def test_two_robots_see_each_other():
    scene = load_small("log_two_robots")
    left, right = scene.arms.values()
    with BulletWorld(scene) as world:
        reach = [0, 0.9, 0, -0.5, 0, 1.5, 0.8]
        world.set_object(translation([0, 0, 5]))
        world.set_arms([(left, reach, 0.05), (right, reach, 0.05)])
        found = [c for c in world.collisions([left, right]) if c.reason == Reason.ROBOT_COLLISION]
        assert found
        assert {c.a.body for c in found} <= {"left", "right"}


def test_answers_do_not_depend_on_what_was_asked_before():
    """The same configuration gets the same answer after any history of other configurations."""
    scene = load_small("bottle_on_table")
    arm = scene.arm()
    configurations = np.random.default_rng(1).uniform(arm.lower, arm.upper, (60, 7))
    with BulletWorld(scene) as world:

        def ask(q):
            world.set_arm(arm, q, 0.05)
            return world.first_collision(arm)

        first = [ask(q) for q in configurations]
        again = [ask(q) for q in configurations[::-1]][::-1]
    assert first == again


def test_margin_is_a_distance_to_keep_from_obstacles():
    """The arm over the table: blocked just beyond its true distance, by nothing but the table."""
    scene = load_small("bottle_on_table")
    arm = scene.arm()
    with BulletWorld(scene) as world:
        world.set_object(translation([0, 0, 5]))
        world.set_arm(arm, arm.home, 0.08)
        world.margin = 0.5
        hit = world.first_collision(arm)
        assert hit is not None
        assert hit.reason == Reason.SCENE_COLLISION
        gap = 0.5 - hit.depth
        world.margin = gap - 1e-6
        assert world.first_collision(arm) is None
        world.margin = gap + 1e-6
        assert world.first_collision(arm) is not None


def test_a_closed_mesh_around_the_object_is_noticed(content, tmp_path):
    trimesh.creation.box((0.2, 0.2, 0.5)).export(tmp_path / "crate.stl")
    crate = {"name": "crate", "mesh": "crate.stl", "pose": {"position": [0.55, 0, 0.15]}}
    content["obstacles"] = [crate]
    with pytest.raises(SceneError, match=r"bottle is 100.0 mm inside crate"):
        check_tasks(Scene.load(write_scene(tmp_path, content)))


def test_a_parked_robot_in_the_object_is_noticed(content, tmp_path):
    robot = content["robots"][0]
    content["robots"].append({**robot, "name": "other", "base": {"position": [0.55, 0, 0]}})
    content["obstacles"] = []
    with pytest.raises(SceneError, match="mm inside other/panda_link"):
        check_tasks(Scene.load(write_scene(tmp_path, content)))


def test_resting_is_standing_on_something():
    scene = load_small("bottle_on_table")
    with BulletWorld(scene) as world:
        assert world.object_rests(scene.task().T_world_object)
        assert not world.object_rests(translation([0.55, 0, 0.1]))
        beside = translation([0.62 - 0.125 - 0.0376, -0.26, 0.15])  # touches the parcel from the side
        assert not world.object_rests(beside)


def test_worlds_do_not_disturb_each_other():
    one, two = load_small("bottle_on_table"), load_small("soda_can")
    arm = one.arm()
    with BulletWorld(one) as a:
        a.set_arm(arm, [0, 1.8, 0, -0.3, 0, 1.5, 0.8], 0.08)
        before = a.collisions([arm])
        with BulletWorld(two) as b, BulletWorld(one) as c:
            b.set_arm(two.arm(), two.arm().home, 0.08)
            c.set_arm(arm, arm.home, 0.08)
            assert a.collisions([arm]) == before
            assert not c.collisions([arm])
        assert a.collisions([arm]) == before


def test_clients_are_given_back():
    """More worlds one after the other than PyBullet has clients, also when building one fails."""
    scene = load_small("soda_can")
    broken = replace(scene, tasks={})
    highest = pybullet.connect(pybullet.DIRECT)
    pybullet.disconnect(highest)
    for _ in range(1100):
        client = pybullet.connect(pybullet.DIRECT)
        pybullet.disconnect(client)
        assert client <= highest
    for _ in range(20):
        with pytest.raises(StopIteration):
            BulletWorld(broken)
        with BulletWorld(scene):
            pass
    client = pybullet.connect(pybullet.DIRECT)
    pybullet.disconnect(client)
    assert client <= highest


def test_objects_may_rest_but_not_sink(content, tmp_path):
    for depth, sunk in ((0.0, False), (0.0009, False), (0.0015, True), (0.012, True)):
        content["tasks"][0]["pose"] = {"position": [0.55, 0, -depth]}
        scene = Scene.load(write_scene(tmp_path, content))
        if not sunk:
            check_tasks(scene)
            continue
        with pytest.raises(SceneError, match=f"bottle is {1e3 * depth:.1f} mm inside table"):
            check_tasks(scene)


@pytest.mark.parametrize("name", shipped_scenes())
def test_shipped_scenes_start_free(name):
    scene = load_small(name)
    check_tasks(scene)
    with BulletWorld(scene) as world:
        assert not world.collisions(list(scene.arms.values()))
