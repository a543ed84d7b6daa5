"""Scenes written by the page are read again; uploaded ones reach no file they should not."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from app.files.scene_files import SCENE_LIMIT, read_scene, scene_yaml
from app.state import changes
from app.state.state import State
from symgrasp.errors import SceneError, SymgraspError, UrdfError
from symgrasp.files import SCENES_DIR, TEMPORARY
from symgrasp.scene.scene import Scene
from tests.conftest import SHIPPED, load_small, write_scene

FOLDERS = (SCENES_DIR,)
LENGTHS = st.floats(-2, 2)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_saved_scene_is_the_same_scene_again_for_page_and_command_line(name, tmp_path):
    scene = changes.moved(State.of(load_small(name), name), x=0.31, lean=0.4).moved_scene()
    text = scene_yaml(scene)
    assert str(SCENES_DIR) not in text  # nothing in it is of this machine only
    read = read_scene("saved.yaml", text.encode(), FOLDERS)
    assert read.option == "saved.yaml (upload)"
    for again in (read.scene, Scene.load(write_scene(tmp_path, text))):
        assert scene_yaml(again) == text
        assert again.file.tasks == scene.file.tasks
        assert np.array_equal(again.profile.points, scene.profile.points)
        assert [o.path and o.path.resolve() for o in again.obstacles] == [
            o.path and o.path.resolve() for o in scene.obstacles
        ]


@settings(deadline=None, max_examples=20)
@given(LENGTHS, LENGTHS, st.floats(0, 3.1), st.floats(-3, 3))
def test_no_pose_is_lost_on_the_way(x, y, lean, towards):
    state = changes.moved(State.of(load_small("bottle_on_table"), ""), x=x, y=y, lean=lean, towards=towards)
    read = read_scene("a.yaml", scene_yaml(state.moved_scene()).encode(), FOLDERS).scene
    assert np.allclose(read.task().T_world_object, state.request.T_world_object, atol=1e-12)


def test_what_others_uploaded_is_not_among_the_servers_files(content, tmp_path):
    """Their folders may lie in that of the scene that the server was started with, such as /tmp."""
    folder = tmp_path / f"{TEMPORARY}abc"
    folder.mkdir()
    (folder / "robot.urdf").write_bytes(b"<robot/>")
    content["robots"][0]["urdf"] = str(folder / "robot.urdf")
    text = yaml.safe_dump(content).encode()
    with pytest.raises(SceneError, match=r"robots\[0\].urdf"):
        read_scene("mine.yaml", text, (tmp_path,))
    with pytest.raises(UrdfError, match="without links"):
        read_scene("mine.yaml", text, (folder,))


def test_files_beside_the_servers_scene_may_be_used_and_are_named_in_the_saved_one(content, tmp_path):
    (tmp_path / "rock.obj").write_bytes((SCENES_DIR / "bowl.obj").read_bytes())
    content["obstacles"].append({"name": "rock", "mesh": "rock.obj", "pose": {"position": [0, 1, 0.5]}})
    text = yaml.safe_dump(content).encode()
    scene = read_scene("mine.yaml", text, (tmp_path, SCENES_DIR)).scene
    assert scene.obstacles[-1].path == tmp_path / "rock.obj"
    saved = scene_yaml(scene)
    assert saved.splitlines()[2] == f"#   '{tmp_path / 'rock.obj'}'"
    assert read_scene("again.yaml", saved.encode(), (tmp_path, SCENES_DIR)).scene.sha256 == scene.sha256
    with pytest.raises(
        SymgraspError, match=r"mine\.yaml: obstacles\[\d\]\.mesh: 'rock\.obj': expected a file"
    ):
        read_scene("mine.yaml", text, FOLDERS)


@pytest.fixture
def secret(tmp_path, monkeypatch):
    """A mesh that exists where no scene of the page may look, also as seen from where the server runs."""
    outside, scenes = tmp_path / "home", tmp_path / "home" / "scenes"
    scenes.mkdir(parents=True)
    (outside / "secret.obj").write_bytes((SCENES_DIR / "bowl.obj").read_bytes())
    (scenes / "way_out.obj").symlink_to(outside / "secret.obj")
    monkeypatch.chdir(outside)
    monkeypatch.syspath_prepend(str(tmp_path))
    return scenes


@pytest.mark.parametrize(
    "reference",
    [
        "{home}/secret.obj",
        "file://{home}/secret.obj",
        "../secret.obj",
        "secret.obj",
        "./way_out.obj",
        "package://home/secret.obj",
        "package://pybullet_data/{up}{home}/secret.obj",
        "package://{up}{home}/secret.obj",
        "package://../secret.obj",
        "package:///secret.obj",
        "\0",
        "~/secret.obj",
        "no_such_file.obj",
    ],
)
@pytest.mark.parametrize("field", ["obstacle", "robot", "hand", "object"])
def test_an_uploaded_scene_reads_no_other_file_and_does_not_say_whether_there_is_one(
    secret, content, reference, field
):
    reference = reference.format(home=secret.parent, up="../" * 20)
    robot = content["robots"][0]
    if field == "obstacle":
        content["obstacles"].append({"name": "rock", "mesh": reference})
    elif field == "robot":
        robot["urdf"] = reference
    elif field == "hand":
        robot["hand"] = {
            "name": "own", "links": ["panda_hand"], "touch_links": [], "joints": {}, "min_opening": 0,
            "max_opening": 0.08, "finger_depth": 0.03, "pad_width": 0.02, "urdf": reference,
        }  # fmt: skip
    else:
        content["object"] = {"name": "rock", "mesh": reference}
    with pytest.raises(SymgraspError) as error:
        read_scene("mine.yaml", yaml.safe_dump(content).encode(), (secret, SCENES_DIR))
    assert str(error.value).endswith(
        "expected a file of an installed package (package://<package>/<path>), or one of the server's scenes"
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (b"\xff\xfe", "mine.yaml: file: .*expected a YAML document"),
        (b"[1, 2]", "mine.yaml: file: .*expected a YAML mapping"),
        (b"a: &a [*a]", "expected a YAML document"),
        (
            b"schema_version: 1\nname: x\n",
            "mine.yaml: robots: nothing: expected a value; this",
        ),
        (b"!!python/object/apply:os.system ['true']", "expected a YAML document"),
        (bytes(SCENE_LIMIT + 1), "mine.yaml: size of the file: 1.0 MB: expected a scene of at most 1 MB"),
    ],
)
def test_what_is_no_scene_is_one_line(text, message):
    with pytest.raises(SymgraspError, match=message) as error:
        read_scene("mine.yaml", text, FOLDERS)
    assert "\n" not in str(error.value)


@settings(deadline=None, max_examples=150)
@given(st.recursive(
    st.none() | st.booleans() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3)
    | st.dictionaries(st.sampled_from(["robots", "object", "tasks", "arms", "hand", "urdf", "name"]), inner),
    max_leaves=12,
))  # fmt: skip
def test_any_content_is_an_error_and_never_an_exception(data):
    with pytest.raises(SymgraspError):
        read_scene("mine.yaml", yaml.safe_dump(data).encode(), FOLDERS)
