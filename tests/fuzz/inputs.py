"""Input that nobody meant to write: scenes, plans, meshes, URDFs and names, each damaged at random."""

from __future__ import annotations

import json
import random
import re
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import trimesh
import yaml

from symgrasp.files import SCENES_DIR

__all__ = ["KINDS", "Case"]


class Case(NamedTuple):
    """A command, and the files that it finds in its folder.

    Attributes:
        argv: arguments of the command.
        files: name → content.
        out: the file that it is asked to write; empty if none.
    """

    argv: list[str]
    files: Mapping[str, bytes]
    out: str = ""


NAMES = (
    "$x^$", "$\\frac{", "\\alpha", "<img src=x onerror=alert(1)>", "</script><b>", "\x1b[31mred\x1b[0m",
    "a\nb", "a\rb", "\u202eabc", "%s {0} {x}", "W" * 100, "W" * 101, "🍾", "'\"`", "a/b", "../up", ".", "-",
    "--help", "", " ", "\x00", "null", "1e5", "&amp;", "日本語", "\ud7ff",
)  # fmt: skip
"""Names that are markup, control characters, paths, options or too long."""

VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 1e-12, -1e-12, 1e4, 1e5, 1e308, -1e308, float("nan"), float("inf"), 2**31,
    2**63, 10**400, "", "0", "1e3", "nan", [], {}, [[]], [0], [0, 0, 0], [1e4] * 3, [[0, 0.03], [0.1, 0.03]],
    {"a": 1}, "package://", "package://pybullet_data/", "package://pybullet_data/franka_panda/panda.urdf",
    "package://nothing/x.urdf", "/dev/zero", "/etc/passwd", "file:///etc/passwd", "%2e%2e/x", "x" * 5000,
)  # fmt: skip

NUMBERS = (b"-1", b"0", b"nan", b"inf", b"1e308", b"99999999999", b"-", b"1e-30", b"4294967295")
"""What a number in a text is replaced by."""

CHANGES = (1, 1, 1, 2, 3)
"""Numbers of changes that are made to a file, equally likely."""


def _tree(rng: random.Random, tree: Any) -> Any:
    """Change a copy of nested data at one place, or seldom at several."""
    tree = json.loads(json.dumps(tree))
    for _ in range(rng.choice(CHANGES)):
        places = list(_places(tree))
        if not places:
            break
        holder, key = rng.choice(places)
        change = rng.randrange(6)
        if change == 0:
            del holder[key]
        elif change == 1 and isinstance(holder[key], (int, float)):
            holder[key] = holder[key] * rng.choice([-1, 0, 1e-6, 1e-3, 0.5, 2, 10, 1e3, 1e6])
        elif change == 2 and isinstance(holder[key], str):
            holder[key] = rng.choice(NAMES)
        elif change == 3:
            other, at = rng.choice(places)
            holder[key] = json.loads(
                json.dumps(other.get(at) if isinstance(other, dict) else other[at % len(other)])
            )
        elif change == 4 and isinstance(holder, dict):
            holder[rng.choice([*NAMES, "scale", "mesh", "urdf", "arms"])] = rng.choice(VALUES)
        else:
            holder[key] = rng.choice([*VALUES, *NAMES])
    return tree


def _places(tree: Any) -> Any:
    """Yield (container, key) of every value in nested data."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in list(items):
        yield tree, key
        yield from _places(value)


def _bytes(rng: random.Random, content: bytes) -> bytes:
    """Damage bytes, seldom at several places: cut, flip, repeat, insert; or change numbers in a text."""
    for _ in range(rng.choice(CHANGES)):
        at = rng.randrange(len(content) + 1)
        change = rng.randrange(7)
        if change == 0:
            content = content[:at]
        elif change == 1 and content:
            at = min(at, len(content) - 1)
            content = content[:at] + bytes([content[at] ^ (1 << rng.randrange(8))]) + content[at + 1 :]
        elif change == 2:
            content = content[:at] + rng.randbytes(rng.randint(1, 30)) + content[at:]
        elif change == 3:
            end = at + rng.randint(1, 300)
            content = content[:end] + content[at:end] * rng.randint(1, 5) + content[end:]
        elif change == 4:
            content = content[:at] + content[at + rng.randint(1, 300) :]
        else:
            numbers = list(re.finditer(rb"-?\d+(\.\d+)?(e[-+]?\d+)?", content[:200_000]))
            if numbers:
                found = rng.choice(numbers)
                value = found[0] + b"1" if rng.random() < 0.5 else rng.choice(NUMBERS)
                content = content[: found.start()] + value + content[found.end() :]
    return content


@cache
def _scene(name: str) -> dict[str, Any]:
    """Return the content of a shipped scene with a small grid."""
    content = yaml.safe_load((SCENES_DIR / f"{name}.yaml").read_text())
    for holder, key in list(_places(content)):
        if key in ("urdf", "mesh") and "://" not in holder[key]:
            holder[key] = f"package://static_scenes/{holder[key]}"
    content["map"] = {**content.get("map", {}), "heights": 6, "angles": 12, "redundancy": 4}
    return content


def scenes(rng: random.Random) -> Case:
    """Return a command on a damaged scene."""
    content = _scene(rng.choice(["bottle_on_table", "soda_can", "pick_pour_place", "log_two_robots"]))
    text = yaml.safe_dump(_tree(rng, content), allow_unicode=True).encode("utf-8", "replace")
    if rng.random() < 0.25:
        text = _bytes(rng, text)
    if rng.random() < 0.05:
        text += b"\na: &a [x, x]\n" + b"".join(
            b"%c: &%c [*%c, *%c, *%c]\n" % (k + 1, k + 1, k, k, k) for k in range(97, 120)
        )
    argv, out = _scene_command(rng)
    return Case(argv, {"scene.yaml": text}, out)


def _scene_command(rng: random.Random) -> tuple[list[str], str]:
    out = rng.choice(["map.json", "map.npz", "map.png", "map.svg"])
    return rng.choice([
        (["map", "scene.yaml", "--out", out], out),
        (["map", "scene.yaml"], ""),
        (["explain", "scene.yaml", "--h", "0.1", "--theta", "30"], ""),
        (["plan", "sequential", "scene.yaml", "--out", "plan.json"], "plan.json"),
        (["plan", "bimanual", "scene.yaml", "--list", "3"], ""),
    ])  # fmt: skip


def plans(rng: random.Random, plan: bytes) -> Case:
    """Return a command on a damaged plan."""
    text = plan if rng.random() < 0.3 else json.dumps(_tree(rng, json.loads(plan))).encode("utf-8", "replace")
    if text is plan or rng.random() < 0.2:
        text = _bytes(rng, text)
    kind, out = rng.choice([("csv", "a.csv"), ("trajectory", "a.json"), ("tsr", "a.yaml")])
    argv, out = rng.choice(
        [(["verify", "plan.json"], ""), (["export", kind, "plan.json", "--out", out], out)]
    )
    return Case(argv, {"plan.json": text}, out)


@cache
def _mesh(ending: str) -> bytes:
    """Return a small bottle as a mesh file."""
    outline = np.array([[0, 0], [0.035, 0], [0.035, 0.14], [0.014, 0.17], [0.014, 0.2], [0, 0.2]])
    mesh = trimesh.creation.revolve(outline, sections=24)
    options = {"encoding": "ascii"} if ending == "ply" else {}
    content = mesh.export(file_type=ending, **options)
    return content.encode() if isinstance(content, str) else bytes(content)


FORMATS = {
    "stl": "stl",
    "stl_ascii": "stl",
    "ply": "ply",
    "obj": "obj",
    "off": "off",
    "glb": "glb",
    "dae": "dae",
}
"""trimesh's name of a format → ending of its files."""


def meshes(rng: random.Random) -> Case:
    """Return a command on a damaged mesh: as an object or as an obstacle."""
    kind = rng.choice(list(FORMATS))
    name = f"mesh.{FORMATS[kind] if rng.random() < 0.95 else rng.choice(list(FORMATS.values()))}"
    files = {name: _bytes(rng, _mesh(kind))}
    if rng.random() < 0.5:
        picture = rng.random() < 0.2
        argv = ["object", name, *(["--out", "object.png"] if picture else [])]
        return Case(
            [*argv, *rng.choice([[]] * 8 + [["--scale", "0.001"], ["--scale", "nan"]])],
            files,
            "object.png" if picture else "",
        )
    content = json.loads(json.dumps(_scene("bottle_on_table")))
    content["obstacles"] = [{"name": "thing", "mesh": name, "pose": {"position": [0.4, 0.3, 0.1]}}]
    return Case(["map", "scene.yaml"], {**files, "scene.yaml": yaml.safe_dump(content).encode()})


@cache
def _urdfs() -> tuple[bytes, ...]:
    """Return URDFs without meshes: a hand, and an arm of seven joints with shapes."""
    hand = (SCENES_DIR / "hands" / "wsg50.urdf").read_bytes()
    names = ["base", *(f"l{k}" for k in range(1, 8))]
    shape = '<origin xyz="0 0 0.05"/><geometry><cylinder radius="0.03" length="0.1"/></geometry>'
    links = [f'<link name="{name}"><collision>{shape}</collision></link>' for name in names]
    joints = [
        f'<joint name="j{k}" type="revolute"><parent link="{names[k - 1]}"/><child link="{names[k]}"/>'
        f'<origin xyz="0 0 {0.3 if k in (3, 5) else 0}"/><axis xyz="{"0 0 1" if k % 2 else "0 1 0"}"/>'
        f'<limit lower="-2.9" upper="2.9" effort="1" velocity="1"/></joint>'
        for k in range(1, 8)
    ]
    text = "\n".join(['<robot name="arm">', *links, *joints, "</robot>"])
    return hand, text.encode()


def urdfs(rng: random.Random) -> Case:
    """Return a command on a damaged URDF: of a hand, an arm, or an obstacle."""
    hand, arm = _urdfs()
    content = json.loads(json.dumps(_scene("bottle_on_table")))
    use = rng.randrange(3)
    if use == 0:
        return Case(["hand", "robot.urdf"], {"robot.urdf": _xml(rng, hand)})
    if use == 1:
        content["robots"] = [{"name": "arm", "urdf": "robot.urdf", "mount": {"link": "l7"}, "hand": "wsg50"}]
        content["tasks"] = [{"name": "pick", "pose": {"position": [0.4, 0, 0]}}]
    else:
        content["obstacles"] = [{"name": "thing", "urdf": "robot.urdf", "pose": {"position": [0.4, 0.4, 0]}}]
    files = {"robot.urdf": _xml(rng, arm), "scene.yaml": yaml.safe_dump(content).encode()}
    return Case(["map", "scene.yaml"], files)


def _xml(rng: random.Random, content: bytes) -> bytes:
    """Damage an XML document: its bytes, its attributes, or its elements."""
    change = rng.randrange(4)
    if change == 0:
        return _bytes(rng, content)
    if change == 1:  # an attribute
        found = rng.choice(list(re.finditer(rb'"([^"]*)"', content)))
        value = rng.choice(
            [
                b"",
                b"nan",
                b"1e300",
                b"-1 -1 -1",
                b"0 0 0",
                b"x",
                b"inf inf inf",
                b"l1",
                b"continuous",
                b"\xff",
            ]
        )
        return content[: found.start(1)] + value + content[found.end(1) :]
    lines = content.splitlines(keepends=True)
    at = rng.randrange(len(lines))
    if change == 2:  # a line is left out, or comes twice
        return b"".join(lines[:at] + (lines[at : at + 1] * 2 if rng.random() < 0.5 else []) + lines[at + 1 :])
    insert = rng.choice([
        b'<joint name="extra" type="floating"><parent link="base"/><child link="l3"/></joint>',
        b'<link name="l1"/>', b"<!-- -->", b"<![CDATA[x]]>", b"&lol;",
        b'<collision><geometry><mesh filename="none.stl"/></geometry></collision>',
        b'<joint name="j9" type="revolute"><parent link="l7"/><child link="l1"/><axis xyz="0 0 0"/></joint>',
        b'<xacro:include filename="x"/>', b'<mimic joint="j1" multiplier="nan"/>',
    ])  # fmt: skip
    return b"".join([*lines[:at], insert, *lines[at:]])


def names(rng: random.Random) -> Case:
    """Return a command on a good scene in which everything has a hostile name."""
    content = json.loads(json.dumps(_scene(rng.choice(["bottle_on_table", "log_two_robots"]))))
    renamed: dict[str, str] = {}
    for kind in ("robots", "obstacles", "tasks"):
        for k, entry in enumerate(content.get(kind, [])):
            renamed[entry["name"]] = entry["name"] = rng.choice(NAMES)[: 100 - len(str(k))] + str(k)
    for task in content["tasks"]:
        task["arms"] = [renamed.get(arm, arm) for arm in task.get("arms", [content["robots"][0]["name"]])]
    content["name"], content["object"]["name"] = rng.choice(NAMES), rng.choice(NAMES)
    argv, out = _scene_command(rng)
    return Case(argv, {"scene.yaml": yaml.safe_dump(content, allow_unicode=rng.random() < 0.5).encode()}, out)


KINDS: Mapping[str, Callable[..., Case]] = {
    "scenes": scenes, "plans": plans, "meshes": meshes, "urdfs": urdfs, "names": names,
}  # fmt: skip
"""Kind of input → the function that makes a case of it."""
