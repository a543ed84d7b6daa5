"""``symgrasp robot``: say what a URDF holds, and write a scene to start from."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from symgrasp.cli.shared import Commands, add_command, add_packages, say, write_out
from symgrasp.errors import InputError, SymgraspError, one_of

if TYPE_CHECKING:
    from symgrasp.found_arms import FoundArm
    from symgrasp.robot.model import RobotModel

__all__ = ["add_parser", "run"]


def add_parser(commands: Commands) -> None:
    """Add the command to the parser."""
    command = add_command(commands, "robot", run, "Say what a URDF holds: arms, hands, solvers.")
    text = "a URDF, xacro or MJCF file, or package://<package>/<path>"
    command.add_argument("urdf", metavar="FILE", help=text)
    add_packages(command)
    text = "value of an argument of a xacro file; may be given several times"
    command.add_argument(
        "--xacro", metavar="NAME:=VALUE", type=_xacro_arg, action="append", default=[], help=text
    )
    text = "turn COLLADA meshes so that the axis which they state as up is z, unlike RViz"
    command.add_argument("--follow-up-axis", action="store_true", help=text)
    text = "write a scene to start from: the robot, and a can where its first arm reaches"
    command.add_argument("--scene", metavar="FILE.yaml", type=Path, help=text)
    command.add_argument(
        "--arm", metavar="NAME", help="the arm that is to reach the can; the first by default"
    )


def _xacro_arg(text: str) -> tuple[str, str]:
    """Read a value of ``--xacro``."""
    name, colon, value = text.partition(":=")
    if not (name and colon):
        raise argparse.ArgumentTypeError(f"{text!r}: expected NAME:=VALUE")
    return name, value


def run(args: argparse.Namespace) -> int:
    """Print what the URDF holds and write the scene if asked to; return the exit status."""
    from symgrasp.references import portable, resolve, sought

    path = resolve(args.urdf, Path())
    if path is None:
        raise InputError("command line", "URDF", args.urdf, sought(args.urdf, Path(), "URDF"))
    if args.scene and args.scene.suffix not in (".yaml", ".yml"):
        raise InputError("command line", "--scene", str(args.scene), "a name that ends in .yaml")

    from symgrasp.descriptions.srdf import find_srdf
    from symgrasp.feasibility.starter import robot_content, starter_scene
    from symgrasp.found_arms import find_arms, in_catalogue
    from symgrasp.robot.model import RobotModel

    xacro_args = dict(args.xacro)
    known = in_catalogue(path)
    reading: dict[str, Any] = dict(known.reading) if known else {}
    if xacro_args:
        reading["xacro_args"] = xacro_args
    if args.follow_up_axis:
        reading["follow_up_axis"] = True
    follow = "follow_up_axis" in reading
    model = RobotModel(path, srdf=find_srdf(path), xacro_args=xacro_args, follow_up_axis=follow)
    say(f"{model.name}: {len(model.link_names)} links, {len(model.joint_names)} joints that take a value")
    arms = find_arms(model)
    usable = [arm for arm in arms if arm.joints and arm.hand is not None]
    name = known.name if known else re.sub(r"\W+", "_", model.name).strip("_") or "robot"
    reference = portable(args.urdf, path) or str(path.resolve())
    entry = robot_content(name, reference, usable, reading) if usable else {}
    solved = []
    for arm in arms:
        _say_arm(arm)
        if arm in usable and _solver_said(entry, arm):
            solved.append(arm)
    if solved:
        _say_home(robot_content(name, reference, solved, reading), solved[0])
    if not arms:
        say("  no arm: no chain of five or more joints that turn")
    _say_missing(model)
    if not follow:
        _say_sideways(model)
    if args.arm:
        if args.arm not in [arm.name for arm in solved]:
            raise InputError("command line", "--arm", args.arm, one_of(arm.name for arm in solved))
        solved.sort(key=lambda arm: arm.name != args.arm)
    if args.scene:
        if not solved:
            raise InputError(path, "robot", name, "an arm with a solver and a hand")
        _write_scene(args.scene, starter_scene(name, reference, solved, reading), solved[0].name)
    return 0


def _write_scene(out: Path, content: dict[str, Any], arm: str) -> None:
    """Write a scene with a can that an arm reaches."""
    import yaml

    x, y, z = content["tasks"][0]["pose"]["position"]
    thick = 200 * content["object"]["profile"][0][1]
    say(f"  a can {thick:g} cm thick at {x:g}, {y:g}, {z:g} m is in reach of {arm}")
    text = yaml.safe_dump(content, sort_keys=False, default_flow_style=None, width=100)
    write_out(out, text.encode())


def _say_arm(arm: FoundArm) -> None:
    """Print the joints and the hand of an arm."""
    if arm.joints:
        source = f", {arm.source}" if arm.source else ""
        say(f"  arm {arm.name}: {len(arm.joints)} joints, {arm.joints[0]} to {arm.joints[-1]}{source}")
    else:
        say(f"  arm {arm.name}")
    if arm.resting:
        say(f"    at rest: {', '.join(arm.resting)}")
    if arm.hand and arm.named:
        say(f"    tool {arm.tool}, no hand of its own; {arm.hand.name} is mounted on it")
    elif arm.hand:
        opening = f"opens from {1e3 * arm.hand.min_opening:.0f} to {1e3 * arm.hand.max_opening:.0f} mm"
        say(f"    hand at {arm.tool}: {opening}, {1e3 * arm.hand.finger_depth:.0f} mm deep")
    if arm.trouble:
        say(f"    {arm.trouble}")


def _say_missing(model: RobotModel) -> None:
    """Print what the URDF lacks."""
    bare = [link for link in model.link_names if not model.has_shape(link)]
    if len(bare) == len(model.link_names):
        say("  missing: no link has a collision shape, so nothing of it collides")
    free = [
        joint.name for joint in model.joints
        if joint.kind != "continuous" and joint.source >= 0 and not abs(joint.upper - joint.lower) < 1e4
    ]  # fmt: skip
    if free:
        say(f"  missing: limits of {', '.join(free)}")


def _say_sideways(model: RobotModel) -> None:
    """Print how many COLLADA meshes state another axis than z as up."""
    import xml.etree.ElementTree as ET

    import numpy as np

    from symgrasp.meshes import read_up

    files = {Path(mesh.get("filename", "")) for mesh in ET.fromstring(model.urdf).iter("mesh")}
    sideways = sum(not np.array_equal(read_up(file), np.eye(4)) for file in files)
    if sideways:
        say(f"  {sideways} COLLADA meshes state another axis than z as up; they are not turned, as in RViz")
        say("    --follow-up-axis turns them")


def _solver_said(entry: dict[str, Any], arm: FoundArm) -> bool:
    """Print how the configurations of an arm are found; return whether they can be."""
    from symgrasp.feasibility.starter import scene_content
    from symgrasp.ik import ArmIK, PitchedIK, solver_for
    from symgrasp.scene.scene import Scene

    one = {**entry, "arms": [a for a in entry["arms"] if a["name"] == arm.name]}
    try:
        scene = Scene.from_content(scene_content(one, arm))
        solver = solver_for(scene.arm(arm.name), 1)
    except SymgraspError as error:
        say(f"    no solver: {error}")
        return False
    assert isinstance(solver, ArmIK | PitchedIK)  # a scene to start from has no torso that moves
    if isinstance(solver, PitchedIK):
        say(f"    solver: {solver.family}" + ("" if solver.complete else "; it may miss some"))
        say("    the pitch of its hand is left free: maps and plans without approach")
        return True
    locked = "" if solver.locked is None else f"; {arm.joints[solver.locked]} locked"
    say(f"    solver: {solver.family}" + locked + ("" if solver.complete else "; it may miss some"))
    return True


def _say_home(entry: dict[str, Any], arm: FoundArm) -> None:
    """Print whether the robot is free of collisions at home."""
    from symgrasp.feasibility.starter import scene_content
    from symgrasp.scene.scene import Scene
    from symgrasp.world import open_world, with_free_homes

    scene = with_free_homes(Scene.from_content(scene_content(entry, arm)))
    with open_world(scene) as world:
        hits = world.collisions(list(scene.arms.values()))
    hit = f"{hits[0].a} is in {hits[0].b}: the scene needs a home" if hits else "free of collisions"
    say(f"  home: {hit}")
    for note in scene.notes:
        say(f"    {note}")
