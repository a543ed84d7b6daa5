"""Exports of motions, read back and followed as a controller would."""

from __future__ import annotations

import base64
import csv
import io
import json
import re

import msgspec
import numpy as np
import pytest
import zstandard
from scipy.interpolate import CubicHermiteSpline

from symgrasp.cli.main import main
from symgrasp.motion.exports import to_actions, to_html, to_table
from symgrasp.motion.record import to_record
from symgrasp.motion.segments import Motion, Segment
from symgrasp.motion.times.timing import timed
from symgrasp.poses import from_position_quat, pose_error
from symgrasp.scene.scene import Scene
from tests.motion.recorded import recorded_motion, recorded_plan


def seconds(stamp: dict[str, int]) -> float:
    return stamp["sec"] + 1e-9 * stamp["nanosec"]


def test_a_controller_that_follows_the_points_follows_the_motion():
    """Cubics through positions and velocities, as ROS controllers make them, stay near the motion."""
    motion = recorded_motion()
    content = json.loads(to_actions(recorded_plan()))
    assert list(content) == ["panda"]
    trajectory = content["panda"]["trajectory"]
    assert trajectory["joint_names"] == list(motion.scene.arm().joint_names)
    times = np.array([seconds(p["time_from_start"]) for p in trajectory["points"]])
    assert np.all(np.diff(times) > 0)
    assert times[-1] == pytest.approx(motion.duration, abs=1e-8)
    positions, velocities = (
        np.array([p[key] for p in trajectory["points"]]) for key in ("positions", "velocities")
    )
    spline = CubicHermiteSpline(times, positions, velocities)
    for t in np.linspace(0, motion.duration, 500):
        q = motion.at(t).values["panda"][motion.scene.arm().indices]
        np.testing.assert_allclose(spline(t), q, atol=2e-4)


def test_hands_move_when_they_do_in_the_motion():
    motion = recorded_motion()
    commands = json.loads(to_actions(recorded_plan()))["panda"]["gripper"]
    names = motion.scene.arm().robot.model.joint_names
    assert [c["goal"]["command"]["position"] for c in commands] == [0.039, 0.029, 0.039]
    for command in commands:
        end = seconds(command["time_from_start"]) + seconds(command["duration"])
        values = motion.at(end).values["panda"]
        for joint, value in command["joints"].items():
            assert values[names.index(joint)] == pytest.approx(value, abs=1e-6)


def test_every_arm_has_its_own_trajectory_and_commands():
    """Both count from one start: the right hand opens, then the left arm moves, then the right one."""
    scene = Scene.load("pr2_handover")
    left, right = (scene.arms[name] for name in ("left", "right"))
    both = set(left.joint_names) & set(right.joint_names)  # those of a torso stay
    there = {
        arm.name: arm.home + 0.1 * np.array([name not in both for name in arm.joint_names])
        for arm in (left, right)
    }
    still = np.stack([right.home, right.home])
    segments = (
        Segment("open", ("right",), {"right": still}, None, {"right": (None, 0.05)}, (), "a", "a"),
        Segment("reach", ("left",), {"left": np.stack([left.home, there["left"]])}, None, {}, (), "a", "a"),
        Segment(
            "reach", ("right",), {"right": np.stack([right.home, there["right"]])}, None, {}, (), "a", "a"
        ),
    )
    motion = timed(Motion(scene, [scene.task().T_world_object], segments))
    record = recorded_plan().scene.model_copy(update={"content": scene.content})
    content = json.loads(
        to_actions(recorded_plan().model_copy(update={"motion": to_record(motion), "scene": record}))
    )
    assert set(content) == {"left", "right"}
    for arm in (left, right):
        trajectory = content[arm.name]["trajectory"]
        assert trajectory["joint_names"] == list(arm.joint_names)
        for point in trajectory["points"]:
            values = motion.at(seconds(point["time_from_start"])).values[arm.robot.name][arm.indices]
            np.testing.assert_allclose(point["positions"], values, atol=1e-6)
        end = trajectory["points"][-1]["positions"]
        np.testing.assert_allclose(end, there[arm.name], atol=1e-9)
    assert content["left"]["gripper"] == []
    (command,) = content["right"]["gripper"]
    assert seconds(command["time_from_start"]) == 0.0
    assert seconds(command["duration"]) == pytest.approx(motion.segments[0].duration, abs=1e-9)
    assert command["goal"]["command"]["position"] == 0.05


def test_the_table_reads_back():
    motion = recorded_motion()
    rows = list(csv.DictReader(io.StringIO(to_table(recorded_plan()))))
    times = np.array([float(row["time"]) for row in rows])
    assert np.all(np.diff(times) > 0)
    assert times[-1] == motion.duration
    for row in rows[::10]:
        state = motion.at(float(row["time"]))
        names = motion.scene.arm().robot.model.joint_names
        assert [float(row[f"panda/{name}"]) for name in names] == state.values["panda"].tolist()
        x, y, z, *quat = (float(row[f"object/{part}"]) for part in ("x", "y", "z", "qw", "qx", "qy", "qz"))
        distance, angle = pose_error(from_position_quat((x, y, z), quat), state.T_world_object)
        assert distance < 1e-12
        assert angle < 1e-7
        assert row["kind"] == motion.segments[int(row["segment"]) - 1].kind


def test_the_document_plays_the_motion_without_a_network():
    """What the recording in it does to the nodes of the robot's links, read as viser's player does."""
    motion = recorded_motion()
    document = to_html(recorded_plan())
    (embedded,) = re.findall(r'__VISER_EMBED_DATA__="([^"]+)"', document)
    assert not re.findall(r"""(?:src|href)\s*=\s*["']https?:""", document)
    packed = base64.b64decode(embedded)
    content = zstandard.ZstdDecompressor().decompress(packed[8:], int.from_bytes(packed[:8], "little"))
    length = int.from_bytes(content[:8], "little")
    recording = msgspec.msgpack.decode(content[8 : 8 + length])
    assert recording["durationSeconds"] == pytest.approx(motion.duration, abs=0.06)
    times = [t for t, message in recording["messages"] if message["type"] == "SetPositionMessage"]
    assert times == sorted(times)
    assert len(set(times)) > 0.8 * motion.duration / 0.05
    last = {m["name"]: m["position"] for _, m in recording["messages"] if m["type"] == "SetPositionMessage"}
    placed = [position for name, position in last.items() if name.endswith("/object")]
    goal = motion.at(motion.duration).T_world_object[:3, 3]
    assert any(np.allclose(position, goal, atol=1e-6) for position in placed)


@pytest.mark.parametrize("name", ["motion", "motion-csv"])
def test_on_the_command_line(name, tmp_path, capsys):
    path, out = tmp_path / "plan.json", tmp_path / "out"
    recorded_plan().save(path)
    assert main(["export", name, str(path), "--out", str(out)]) == 0
    assert out.stat().st_size > 10_000
    recorded_plan().model_copy(update={"motion": None}).save(path)
    assert main(["export", name, str(path), "--out", str(tmp_path / "none")]) == 2
    assert "motion: nothing: expected a plan with a motion" in capsys.readouterr().err
    assert not (tmp_path / "none").exists()
