"""xacro files: what they expand to, what they may not do, and what is said of those that do not expand."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from symgrasp.cli.main import main
from symgrasp.descriptions import xacro_file
from symgrasp.descriptions.srdf import find_srdf, read_srdf
from symgrasp.descriptions.xacro_file import expand_xacro
from symgrasp.errors import SceneError, UrdfError
from symgrasp.poses import from_position_rpy
from symgrasp.references import VARIABLE, give_packages
from symgrasp.robot.assembly import assemble
from symgrasp.robot.model import RobotModel
from symgrasp.scene.scene import Scene

ARM = Path(__file__).parent.parent / "data/arm_description/urdf/arm.urdf.xacro"
HEAD = '<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro">'


@settings(max_examples=3, deadline=None)
@given(scale=st.floats(0.5, 2), seed=st.integers(0, 1000))
def test_an_arm_has_the_lengths_of_its_files_times_the_argument(scale, seed):
    """Macros, an included file, a YAML file with units, ``$(find)`` and arguments, against the formula."""
    model = RobotModel(ARM, xacro_args={"scale": str(scale), "prefix": "my_"})
    assert model.joint_names == tuple(f"my_joint{k}" for k in range(1, 7))
    q = np.random.default_rng(seed).uniform(-1, 1, 6)
    expected = np.eye(4)
    lengths = (0.2, 0.1, 0.4, 0.35, 0.1, 0.08)
    for value, length, axis in zip(q, lengths, "zyyzyz", strict=True):
        turn = [0.0, value, 0.0] if axis == "y" else [0.0, 0.0, value]
        expected = expected @ from_position_rpy([0, 0, length * scale], turn)
    assert np.allclose(model.forward(q)[-1], expected, atol=1e-12)
    assert model.lower[4] == pytest.approx(-np.deg2rad(115))
    assert model.shapes("my_link2")[0].size == pytest.approx((0.05, 0.05, 0.4 * scale - 0.05))


def test_a_scene_takes_arguments_and_keeps_them(content):
    robot: dict[str, Any] = {"name": "arm", "urdf": str(ARM), "hand": "wsg50", "mount": {"link": "my_link6"}}
    content["robots"] = [robot | {"xacro_args": {"prefix": "my_", "scale": 1.5}}]
    content["tasks"] = content["tasks"][:1]
    content["tasks"][0].pop("arms", None)
    scene = Scene.from_content(content)
    assert scene.robots["arm"].model.forward(np.zeros(6 + 1))[6, 2, 3] == pytest.approx(1.5 * 1.23)
    again = Scene.from_content(scene.content)
    assert again.robots["arm"].model == scene.robots["arm"].model
    content["robots"][0]["urdf"] = "package://pybullet_data/franka_panda/panda.urdf"
    with pytest.raises(UrdfError, match=r"xacro_args: \['prefix', 'scale'\]: expected a xacro file"):
        Scene.from_content(content)
    content["robots"][0]["xacro_args"] = {"prefix": ["my_"]}
    with pytest.raises(SceneError, match=r"robots\[0\].xacro_args.prefix"):
        Scene.from_content(content)


def test_a_flag_is_what_xacro_calls_it(tmp_path):
    text = '<xacro:arg name="on" default="false"/><xacro:if value="$(arg on)"><link name="l"/></xacro:if>'
    path = written(tmp_path, text + '<link name="${str(python.type(3))[8:11]}"/>')
    names = [link.get("name") for link in expand_xacro(path, {"on": "true"})]
    assert names == ["l", "int"]
    assert len(expand_xacro(path, {})) == 1


def test_packages_are_those_of_references(tmp_path, monkeypatch):
    parts, inside = tmp_path / "elsewhere", tmp_path / "inside"
    parts.mkdir()
    inside.mkdir()
    path = written(inside, '<xacro:include filename="$(find parts)/one.xacro"/>')
    (parts / "one.xacro").write_text(f'{HEAD}<link name="one"/></robot>')
    with pytest.raises(
        UrdfError, match=r"xacro: \$\(find\): 'parts': expected a package .* --package parts="
    ):
        expand_xacro(path, {})
    monkeypatch.setenv(VARIABLE, "")
    give_packages([f"parts={parts}"])
    assert expand_xacro(path, {})[0].get("name") == "one"
    with pytest.raises(UrdfError, match="expected a package that can be found"):
        expand_xacro(path, {}, inside=inside)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<link name="$(arg side)"/>',
         r"xacro: argument: 'side': expected a value: xacro_args: {side: …} in the scene, or --xacro side:="),
        ('<link name="${lenght}"/>', "name 'lenght' is not defined when evaluating expression 'lenght'"),
        ('<xacro:macro name="m" params="n"/><xacro:m/>', r"macro m: 'Undefined parameters \[n\]'"),
        ('<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>', "without endless recursion"),
        ("<xacro:finger/>", "unknown macro name: xacro:finger"),
        ('<xacro:include filename="no.xacro"/>', "no.xacro': expected an existing file"),
        ('<xacro:include filename="part.xacro"/>', "in part.xacro: 'no element found"),
        ("<link", "not well-formed"),
        ("<link name=\"${'x' * 10**10}\"/>", "expands in little memory"),
        ("<link name=\"${'x' * 6 * 10**6}\"/>", "expands to at most 5 MB"),
        ('<joint/>', "<robot> without links"),
    ],
)  # fmt: skip
def test_what_does_not_expand_is_one_line(tmp_path, text, message):
    (tmp_path / "part.xacro").write_text("<robot>")
    with pytest.raises(UrdfError, match=message) as caught:
        RobotModel(written(tmp_path, text))
    assert "\n" not in str(caught.value)
    assert "arm.urdf.xacro" in str(caught.value)


def test_arguments_that_the_file_does_not_have_are_refused(capsys):
    assert main(["robot", str(ARM), "--xacro", "scal:=2"]) == 2
    assert "xacro_args: 'scal': expected one of 'prefix', 'scale'" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["robot", str(ARM), "--xacro", "scale=2"])
    assert "expected NAME:=VALUE" in capsys.readouterr().err


@pytest.mark.parametrize(
    "text",
    [
        '<xacro:include filename="/etc/hostname"/>',
        '<xacro:include filename="../secret.xacro"/>',
        '<xacro:include filename="link.xacro"/>',
        '<xacro:include filename="../*.xacro"/>',
        "<link name=\"${xacro.load_yaml('../secret.xacro')}\"/>",
        "<link name=\"${xacro.load_yaml('/proc/self/environ')}\"/>",
        "<xacro:include filename=\"${xacro.abs_filename('../secret.xacro')}\"/>",
        "<link name=\"${(lambda: ''.__class__.__base__.__subclasses__())()}\"/>",
        '<link name="${[f for f in [(x for x in [1]).gi_frame]]}"/>',
        '<link name="${python.type(1).mro()}"/>',
        '<link name="$(eval open.__self__)"/>',
        '<link name="$(eval [exec, open])"/>',
        '<link name="$(env HOME)"/>',
        '<link name="$(find static_scenes)"/>',
        '<xacro:include filename="$(find static_scenes)/hands/wsg50.urdf"/>',
    ],
)
def test_a_file_from_elsewhere_reads_nothing_outside_its_folder(tmp_path, text):
    inside = tmp_path / "inside"
    inside.mkdir()
    (tmp_path / "secret.xacro").write_text(f'{HEAD}<link name="secret"/></robot>')
    (inside / "link.xacro").symlink_to(tmp_path / "secret.xacro")
    with pytest.raises(
        UrdfError, match=r"nothing but its own parts|is not set|is not defined|a package that"
    ):
        expand_xacro(written(inside, text), {}, inside=inside)


def test_the_environment_stays_outside_of_a_file_from_elsewhere(tmp_path, monkeypatch):
    monkeypatch.setenv("SECRET", "s3cret")
    path = written(tmp_path, '<link name="$(optenv SECRET none)"/>')
    assert expand_xacro(path, {}, inside=tmp_path)[0].get("name") == "none"
    assert expand_xacro(path, {})[0].get("name") == "s3cret"


ACTIONS = """
import os, shutil, socket, subprocess, sys, urllib.request
from pathlib import Path
from symgrasp.descriptions import xacro_process

inside = Path(sys.argv[1]).resolve()
(inside / "a").write_text("a")
xacro_process._confine(inside / "a", inside)
assert open(inside / "a").read() == "a"
actions = {
    "read": lambda: open("/etc/hostname"), "list": lambda: os.listdir("/"), "walk": lambda: os.scandir("/"),
    "raw": lambda: os.open("/etc/hostname", os.O_RDONLY), "path": lambda: Path("/etc/hostname").read_text(),
    "write": lambda: open(inside / "b", "w"), "append": lambda: os.open(inside / "a", os.O_RDWR),
    "remove": lambda: os.remove(inside / "a"), "rename": lambda: os.rename(inside / "a", inside / "c"),
    "mkdir": lambda: os.mkdir(inside / "d"), "link": lambda: os.symlink("/etc", inside / "e"),
    "copy": lambda: shutil.copyfile(inside / "a", inside / "f"), "chmod": lambda: os.chmod(inside / "a", 0),
    "system": lambda: os.system("true"), "run": lambda: subprocess.run(["true"]), "fork": os.fork,
    "exec": lambda: os.execv("/bin/true", ["true"]), "spawn": lambda: os.posix_spawn("/bin/true", ["t"], {}),
    "socket": socket.socket, "fetch": lambda: urllib.request.urlopen("http://127.0.0.1:9"),
    "kill": lambda: os.kill(os.getpid(), 0), "import": lambda: __import__("ctypes"),
}
for name, action in actions.items():
    try:
        action()
    except PermissionError as error:
        continue
    print("allowed:", name, flush=True)
print("tried", len(actions), flush=True)
os._exit(0)
"""


def test_whatever_an_expression_comes_to_only_files_of_the_folder_are_read(tmp_path):
    run = subprocess.run([sys.executable, "-c", ACTIONS, tmp_path], capture_output=True, text=True)
    assert (run.stdout, run.stderr) == ("tried 22\n", "")
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_an_expansion_that_does_not_end_is_stopped(tmp_path, monkeypatch):
    monkeypatch.setattr(xacro_file, "CPU_SECONDS", 1)
    path = written(tmp_path, '<link name="${len([1 for i in python.range(10**9) if not i])}"/>')
    with pytest.raises(UrdfError, match="'no answer': expected a file that expands within 1 s and 1 GB"):
        expand_xacro(path, {})


def test_without_the_extra_the_line_says_what_to_install(monkeypatch):
    monkeypatch.setattr(xacro_file, "find_spec", lambda name: None)
    with pytest.raises(UrdfError) as caught:
        assemble(ARM)
    expected = "'a xacro file': expected pip install 'symgrasp[xacro]', or a plain URDF: xacro arm.urdf.xacro"
    assert expected in str(caught.value)


def test_modules_beside_the_file_are_not_imported(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("xacro", "yaml", "json"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('a foreign module')")
    assert expand_xacro(written(tmp_path, '<link name="l"/>'), {})[0].get("name") == "l"


def test_the_srdf_of_a_xacro_file(tmp_path):
    path = written(tmp_path, '<link name="l"/>')
    (tmp_path / "arm.srdf").write_text('<robot name="a"/>')
    (tmp_path / "other.srdf").write_text('<robot name="a"/>')
    assert find_srdf(path) == tmp_path / "arm.srdf"
    (tmp_path / "arm.srdf.xacro").write_text(f'{HEAD}<xacro:include filename="x"/></robot>')
    with pytest.raises(UrdfError, match="'a xacro file': expected a plain SRDF: xacro arm"):
        read_srdf(tmp_path / "arm.srdf.xacro")


def written(folder: Path, text: str) -> Path:
    """Write a xacro file."""
    path = folder / "arm.urdf.xacro"
    path.write_text(f"{HEAD}{text}</robot>")
    return path
