"""Robots in place of those of a scene: from the catalogue, and from archives that people upload."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from app.compute.upload_service import UploadService
from app.files.archives import pack, unpack
from app.files.scene_files import scene_archive
from symgrasp.errors import InputError, SymgraspError
from symgrasp.files import SCENES_DIR
from symgrasp.robot.catalogue import CATALOGUE
from symgrasp.scene.scene import Scene
from tests.app.robot_archives import PANDA, panda_archive

DATA = Path(__file__).parents[2] / "data"

IIWA = next(robot for robot in CATALOGUE if robot.name == "iiwa")


def quiet(share: float) -> None:
    pass


@pytest.fixture(scope="module")
def bottle() -> Scene:
    return Scene.load("bottle_on_table")


@pytest.fixture
def service() -> UploadService:
    return UploadService((SCENES_DIR,))


def test_a_robot_of_the_catalogue_takes_the_place_of_another(service, bottle):
    built = service.put_robot(bottle, "panda", IIWA, bottle, quiet)
    scene = built.scene
    assert (list(scene.robots), scene.task().arms) == (["iiwa"], tuple(scene.arms))
    assert np.array_equal(scene.profile.points, bottle.profile.points)
    assert scene.file.obstacles == bottle.file.obstacles
    assert np.array_equal(scene.task().T_world_object, bottle.task().T_world_object)
    assert set(built.visuals) == {scene.robots["iiwa"].model.urdf}
    # it stands as high as the other did, and its first joint is in the same direction from the object
    old, new = (s.robots[n].T_world_base[:3, 3] + a.P[0] for s, n, a in (
        (bottle, "panda", bottle.arm()), (scene, "iiwa", scene.arm()),
    ))  # fmt: skip
    assert scene.robots["iiwa"].T_world_base[2, 3] == pytest.approx(0.0, abs=2e-3)
    point = bottle.task().T_world_object[:3, 3]
    assert np.allclose(*(np.arctan2(*(p - point)[:2]) for p in (old, new)))


def test_where_a_robot_stands_does_not_depend_on_which_was_there_before(service, bottle):
    ur5 = next(robot for robot in CATALOGUE if robot.name == "ur5")
    changed = service.put_robot(bottle, "panda", ur5, bottle, quiet).scene
    again = service.put_robot(changed, "ur5", IIWA, bottle, quiet).scene
    at_once = service.put_robot(bottle, "panda", IIWA, bottle, quiet).scene
    assert again.file.robots[0].base == at_once.file.robots[0].base


def test_the_own_robot_comes_back_as_it_was(service, bottle):
    changed = service.put_robot(bottle, "panda", IIWA, bottle, quiet).scene
    again = service.put_robot(changed, "iiwa", bottle.file.robots[0], bottle, quiet).scene
    assert again.task().arms == ("panda",)
    entry = again.file.robots[0]
    assert entry.model_copy(update={"base": bottle.file.robots[0].base}) == bottle.file.robots[0]


def test_names_that_are_taken_get_a_number(service):
    scene = Scene.load("handover_between_robots")
    first, second = scene.robots
    changed = service.put_robot(scene, second, replace(IIWA, name=first), scene, quiet)
    assert list(changed.scene.robots) == [first, f"{first}_2"]


def test_an_uploaded_robot_is_the_robot(service, bottle, tmp_path):
    entry, built = service.read_robot(
        bottle, "panda", "my panda.zip", panda_archive(), tmp_path, bottle, quiet
    )
    arm, own = built.scene.arm(), bottle.arm()
    assert arm.joint_names == own.joint_names
    q = np.linspace(-0.5, 0.5, 7)
    assert np.allclose(arm.tool_pose(q)[:3, 3], own.tool_pose(q)[:3, 3], atol=5e-3)  # measured
    assert np.isclose(arm.hand.max_opening, own.hand.max_opening, atol=1e-3)
    assert Path(entry.urdf).is_relative_to(tmp_path.resolve())
    assert all(robot.model.urdf in built.visuals for robot in built.scene.robots.values())


def test_a_saved_archive_opens_again_here_and_on_the_command_line(service, bottle, tmp_path):
    folder = tmp_path / "upload"
    folder.mkdir()
    scene = service.read_robot(bottle, "panda", "p.zip", panda_archive(), folder, bottle, quiet)[1].scene
    content = scene_archive(scene, "mine.yaml", [folder])
    there = tmp_path / "there"
    unpack("mine.zip", content, there)
    text = (there / "mine.yaml").read_text(encoding="utf-8")
    assert str(tmp_path) not in text
    folder.rename(tmp_path / "gone")
    loaded = Scene.load(there / "mine.yaml")
    assert loaded.arm().joint_names == scene.arm().joint_names
    again = tmp_path / "again"
    again.mkdir()
    opened = service.read_scene("mine.zip", content, again, quiet)
    assert (opened.option, list(opened.scene.arms)) == ("mine.zip (upload)", list(scene.arms))
    assert np.allclose(opened.scene.robots["panda"].T_world_base, scene.robots["panda"].T_world_base)


@pytest.mark.parametrize(
    "reference", ["/etc/passwd", "../../../../../etc/passwd", "file:///etc/passwd", "/etc/no"]
)
def test_a_robot_refers_to_no_file_of_the_server(reference, service, bottle, tmp_path):
    urdf = (PANDA / "panda.urdf").read_text(encoding="utf-8")
    urdf = re.sub(r'filename="[^"]*"', f'filename="{reference}"', urdf)
    with pytest.raises(InputError, match="a file of the archive, or of an installed package"):
        service.read_robot(
            bottle, "panda", "p.zip", pack([("a.urdf", urdf.encode())]), tmp_path, bottle, quiet
        )


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ({"readme.txt": b""}, "one .urdf, .xacro or MJCF file"),
        ({"a.urdf": b"", "b.urdf": b""}, "one .urdf file"),
        ({"a.xacro": b"<a/>", "b.xacro": b"<a/>"}, "one .xacro file"),
        ({"a.xml": b"<mujoco/>", "b.xml": b"<mujoco/>", "package.xml": b"<package/>"}, "one .xml file"),
        ({"a.xml": b'<mujoco><asset><mesh file="/etc/passwd"/></asset></mujoco>'}, "a file of the archive"),
        ({"a.urdf": b"<robot"}, "a valid URDF document"),
        ({"a.urdf": b'<robot name="x"><link name="a"/></robot>'}, "an arm of five or more joints"),
    ],
)
def test_what_is_no_robot_is_refused_in_one_line(files, expected, service, bottle, tmp_path):
    with pytest.raises(SymgraspError, match=expected) as caught:
        service.read_robot(bottle, "panda", "p.zip", pack(files.items()), tmp_path, bottle, quiet)
    assert "\n" not in str(caught.value)


def test_an_uploaded_xacro_file_is_expanded_once_and_saved_as_a_urdf(service, bottle, tmp_path):
    folder = tmp_path / "upload"
    folder.mkdir()
    files = {f"ws/arm_description/{k}": v for k, v in arm_files().items()}
    entry, built = service.read_robot(bottle, "panda", "arm.zip", pack(files.items()), folder, bottle, quiet)
    assert Path(entry.urdf) == folder.resolve() / "ws/arm_description/urdf/arm.urdf"
    assert entry.xacro_args is None
    model = built.scene.arm().robot.model
    assert model.joint_names[:6] == tuple(f"joint{k}" for k in range(1, 7))
    there = tmp_path / "there"
    unpack("mine.zip", scene_archive(built.scene, "mine.yaml", [folder]), there)
    folder.rename(tmp_path / "gone")
    assert Scene.load(there / "mine.yaml").arm().robot.model.link_names == model.link_names


def test_an_uploaded_mjcf_file_is_converted_once_and_saved_as_urdf_and_srdf(service, bottle, tmp_path):
    folder = tmp_path / "upload"
    folder.mkdir()
    files = {name: content for name, content in arm_files().items() if name.startswith("mjcf")}
    entry, built = service.read_robot(bottle, "panda", "arm.zip", pack(files.items()), folder, bottle, quiet)
    assert Path(entry.urdf) == folder.resolve() / "mjcf/arm.urdf"
    model = built.scene.arm().robot.model
    assert model.allowed_pairs() == {frozenset(("link1", "link3"))}
    there = tmp_path / "there"
    unpack("mine.zip", scene_archive(built.scene, "mine.yaml", [folder]), there)
    again = Scene.load(there / "mine.yaml").arm().robot.model
    assert (again.link_names, again.allowed_pairs()) == (model.link_names, model.allowed_pairs())


def test_a_scene_in_an_archive_gives_arguments_to_its_xacro_file(service, bottle, tmp_path):
    robot = {"name": "arm", "urdf": "urdf/arm.urdf.xacro", "hand": "wsg50", "mount": {"link": "my_link6"}}
    content = {key: value for key, value in bottle.content.items() if key != "robots"}
    content["robots"] = [robot | {"xacro_args": {"prefix": "my_", "scale": 1.25}}]
    content["tasks"] = [{"name": "hold", "pose": content["tasks"][0]["pose"]}]
    files = {"arm.yaml": yaml.safe_dump(content).encode(), **arm_files()}
    opened = service.read_scene("arm.zip", pack(files.items()), tmp_path, quiet).scene
    model = opened.robots["arm"].model
    assert model.forward(model.default_values())[6, 2, 3] == pytest.approx(1.25 * 1.23)
    assert opened.file.robots[0].xacro_args is None
    assert Path(opened.file.robots[0].urdf).name == "arm.urdf"


@pytest.mark.parametrize(
    "text",
    [
        '<xacro:include filename="/etc/hostname"/>',
        "<link name=\"${xacro.load_yaml('../../../../etc/hostname')}\"/>",
        '<link name="l"><visual><geometry><mesh filename="/etc/hostname"/></geometry></visual></link>',
        '<xacro:include filename="$(find static_scenes)/hands/wsg50.urdf"/>',
    ],
)
@pytest.mark.parametrize("name", ["arm.urdf.xacro", "arm.urdf"])
def test_a_xacro_file_reads_no_file_of_the_server(text, name, service, bottle, tmp_path):
    content = (
        f'<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro">{text}<xacro:if value="0"/></robot>'
    )
    with pytest.raises(InputError, match=r"its own parts|a file of the archive|a package that can be found"):
        service.read_robot(
            bottle, "panda", "p.zip", pack([(name, content.encode())]), tmp_path, bottle, quiet
        )


def test_a_scene_alone_gives_no_paths_to_xacro_files_of_the_server(service, bottle):
    robot = bottle.content["robots"][0] | {"xacro_args": {"a": "../../etc/hostname"}}
    content = yaml.safe_dump(bottle.content | {"robots": [robot]}).encode()
    with pytest.raises(SymgraspError, match=r"robots\[0\].xacro_args.a: .* expected words or numbers"):
        service.read_scene("s.yaml", content, None, quiet)


def arm_files() -> dict[str, bytes]:
    """Return the files of a robot in xacro and in MJCF: name in its package → content."""
    folder = Path(__file__).parents[2] / "data/arm_description"
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def test_a_urdf_alone_is_a_robot(service, bottle, tmp_path):
    content = (DATA / "three_parallel.urdf").read_bytes()
    built = service.read_robot(bottle, "panda", "my arm.URDF", content, tmp_path, bottle, quiet)[1]
    assert list(built.scene.robots) == ["my_arm"]
    assert len(built.scene.arm().joint_names) == 6


def test_obstacles_of_an_archive_are_refused(service, bottle, tmp_path):
    """The server would have to read them to draw them."""
    content = bottle.content | {"obstacles": [{"name": "x", "mesh": "x.obj"}]}
    files = {"scene.yaml": yaml.safe_dump(content).encode(), "x.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"}
    with pytest.raises(SymgraspError, match="one of the server's scenes"):
        service.read_scene("s.zip", pack(files.items()), tmp_path, quiet)


def test_another_hand_on_a_link(service, bottle):
    changed = service.rearm(bottle, "panda", "panda_link8", "wsg50", quiet).scene
    assert changed.arm().hand.urdf is not None
    assert changed.replaceable_hands == {"panda": "wsg50"}
    back = service.rearm(changed, "panda", "panda_grasptarget", None, quiet).scene
    assert back.arm().hand.max_opening == pytest.approx(0.08, abs=1e-3)
