"""Links that open the page as it is now: scene, object, hands, poses, grasp and camera in the address.

A link is readable, so that people may write one by hand; lengths are in cm, angles in degrees.

    ?scene=pick_pour_place&task=pour&arm=panda&turn=30&at.pour=50,10,30,110,90,0&h=12&theta=-40

It names what the server has. What was uploaded is not in it: a saved scene file carries that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from urllib.parse import parse_qsl, urlencode

import numpy as np

from app.state import Pick, State
from app.values import ObjectPose, RollChoice
from symgrasp.errors import InputError, one_of
from symgrasp.manifold import ROLLS
from symgrasp.views import View

__all__ = ["Link", "link_of", "parse_link"]

LONGEST = 4000
"""Characters of a link that are looked at."""

VISER = ("websocket", "darkMode", "showStats", "hideViserLogo", "fixedDpr")
"""What viser's own page understands in an address."""

REACH = 1000.0
"""No coordinate in a link is larger (m)."""

ROUNDING = 1e-9
"""What the end of the object may have moved by being written down (m)."""

Camera = tuple[float, ...]
"""Where the camera stands and the point it looks at (m): six numbers."""


@dataclass(frozen=True)
class Link:
    """What a link says.

    Attributes:
        scene: name of the scene; the server's first if None.
        object: name of an object of the library; the scene's own if None.
        hands: arm → name of the hand mounted on it.
        camera: see `Camera`; None leaves it to the page.
        settings: everything else, as it stands in the address.
    """

    scene: str | None = None
    object: str | None = None
    hands: Mapping[str, str] = field(default_factory=dict)
    camera: Camera | None = None
    settings: Mapping[str, str] = field(default_factory=dict)

    def apply(self, state: State) -> State:
        """Return the first state of the link's scene, set up as the link says.

        Raises:
            SymgraspError: a setting is none, or its value is unusable.
        """
        turn = 0.0
        for key, text in self.settings.items():
            if key == "task":
                state = state.choose_task(text)
            elif key == "arm":
                arms = state.scene.task(state.task).arms
                state = state.choose_arm(_one(key, text, arms))
            elif key == "turn":
                turn = np.deg2rad(_number(key, text))
            elif key == "roll":
                state = state.choose_roll(RollChoice(_one(key, text, [r.value for r in RollChoice])))
            elif key == "view":
                view = View(_one(key, text, [v.value for v in View]))
                state = replace(state, looking=replace(state.looking, view=view))
            elif key in SWITCHES:
                state = replace(state, **{key: _one(key, text, ("0", "1")) == "1"})
            elif key.startswith("at."):
                state = _move(state, key, text)
            elif key not in ("h", "theta", "side"):
                raise InputError("link", key, text, one_of((*KEYS, "at.<task>", "hand.<arm>"), key))
        return self._pick(state.turn(turn))

    def _pick(self, state: State) -> State:
        if "h" not in self.settings:
            return state
        h, theta = (_number(key, self.settings.get(key, "0")) for key in ("h", "theta"))
        profile = state.scene.profile
        inside = float(np.clip(h / 100, profile.h_min, profile.h_max))
        h = inside if abs(inside - h / 100) < ROUNDING else h / 100
        state = state.choose(h, np.deg2rad(theta))
        if "side" not in self.settings or state.pick is None:
            return state
        sides = [f"{np.rad2deg(roll):.0f}" for roll in ROLLS]
        side = _one("side", self.settings["side"], sides)
        return replace(state, pick=Pick(state.pick.h, state.pick.theta, sides.index(side)))


SWITCHES = ("board", "gizmo", "dark")
KEYS = ("scene", "object", "camera", "task", "arm", "turn", "roll", "view", *SWITCHES, "h", "theta", "side")


def link_of(state: State, camera: Camera | None = None) -> str:
    """Return what stands behind the ``?`` of the address that opens a state again.

    Raises:
        SymgraspError: something that was uploaded is shown.
    """
    for what, uploaded in (("scene", state.own_scene), ("object", state.thing and state.thing.measurement)):
        if uploaded:
            raise InputError("link", what, "an upload", "something the server has; save the scene instead")
    parts: dict[str, str] = {"scene": state.scene_name}
    if state.thing:
        parts["object"] = state.thing.choice
    parts |= {f"hand.{arm}": hand for arm, hand in state.scene.mounted.items()}
    parts |= {"task": state.task, "arm": state.arm}
    for task, pose in state.poses.items():
        lengths = (100 * v for v in (pose.x, pose.y, pose.z))
        angles = np.rad2deg((pose.lean, pose.towards, pose.spin))
        parts[f"at.{task}"] = ",".join(_short(v) for v in (*lengths, *angles))
    optional: list[tuple[str, bool, Callable[[], str]]] = [
        ("turn", state.delta != 0, lambda: _short(np.rad2deg(state.delta))),
        ("roll", state.roll is not RollChoice.EITHER, lambda: state.roll.value),
        ("view", state.looking.view is not View.REASON, lambda: state.looking.view.value),
        ("board", not state.board, lambda: "0"),
        ("gizmo", state.gizmo, lambda: "1"),
        ("dark", state.dark, lambda: "1"),
        ("camera", camera is not None, lambda: ",".join(f"{v:.3f}" for v in camera or ())),
    ]
    parts |= {key: text() for key, present, text in optional if present}
    if state.pick:
        parts |= {"h": _short(100 * state.pick.h), "theta": _short(np.rad2deg(state.pick.theta))}
        if state.pick.roll is not None:
            parts["side"] = f"{np.rad2deg(ROLLS[state.pick.roll]):.0f}"
    return urlencode(parts, safe=",°")


def parse_link(query: str) -> Link:
    """Read what stands behind the ``?`` of an address; what only viser understands is left to it.

    Raises:
        InputError: it is no link of this page.
    """
    if len(query) > LONGEST:
        raise InputError("link", "length", len(query), f"at most {LONGEST} characters")
    settings: dict[str, str] = {}
    for key, value in parse_qsl(query, keep_blank_values=True):
        if key in VISER or key.startswith("initialCamera"):
            continue
        if key in settings:
            raise InputError("link", key, value, "every setting once")
        settings[key] = value
    hands = {key[5:]: settings.pop(key) for key in list(settings) if key.startswith("hand.")}
    camera = settings.pop("camera", None)
    return Link(
        settings.pop("scene", None),
        settings.pop("object", None),
        hands,
        None if camera is None else tuple(_numbers("camera", camera)),
        settings,
    )


def _move(state: State, key: str, text: str) -> State:
    task = state.scene.task(key.removeprefix("at.")).name
    x, y, z, *angles = _numbers(key, text)
    pose = ObjectPose(x / 100, y / 100, z / 100, *np.deg2rad(angles).tolist())
    return replace(state, poses={**state.poses, task: pose})


def _numbers(key: str, text: str) -> list[float]:
    values = text.split(",")
    if len(values) != 6:
        raise InputError("link", key, text, "six numbers with commas between them")
    return [_number(key, value) for value in values]


def _number(key: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not abs(value) <= 100 * REACH:
        raise InputError("link", key, text, "a number")
    return value


def _one(key: str, text: str, choices: tuple[str, ...] | list[str]) -> str:
    if text not in choices:
        raise InputError("link", key, text, one_of(choices, text))
    return text


def _short(value: float) -> str:
    return f"{value + 0.0:.12g}"
