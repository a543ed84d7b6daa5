"""Links that open the page as it is now: scene, object, hands, tasks, grasp and camera in the address.

A link is readable, so that people may write one by hand; lengths are in cm, angles in degrees.

    ?scene=pick_pour_place&task=pour&arm=panda&turn=30&at.pour=50,10,30,110,90,0&h=12&theta=-40

It names what the server has, and how the tasks differ from there (see `app.files.link_tasks`). What was
uploaded is not in it: a saved scene file carries that.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from urllib.parse import parse_qsl, urlencode

import numpy as np

from symgrasp.errors import InputError, one_of
from symgrasp.feasibility.color_by import ColorBy
from symgrasp.object.manifold import ROLLS
from symgrasp.scene.scene import Scene

from ..state import changes
from ..state.map_view_state import RollChoice
from ..state.page_link import Camera
from ..state.state import Pick, State
from .link_tasks import is_about_tasks, read_tasks, tasks_text
from .link_values import number, number_text, numbers, one

__all__ = ["Link", "link_of", "parse_link"]

LONGEST = 4000
"""Characters of a link that are looked at: browsers tell the server of no address above 4096."""

VISER = ("websocket", "darkMode", "showStats", "hideViserLogo", "fixedDpr")
"""What viser's own page understands in an address."""

ROUNDING = 1e-9
"""What the end of the object may have moved by being written down (m)."""


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
        state = read_tasks(state, self.settings)
        for key, text in self.settings.items():
            if key == "task":
                state = changes.choose_task(state, text)
            elif key == "arm":
                arms = state.scene.task(state.task).arms
                state = changes.choose_arm(state, one(key, text, arms))
            elif key == "turn":
                turn = np.deg2rad(number(key, text))
            elif key == "roll":
                state = changes.choose_roll(state, RollChoice(one(key, text, [r.value for r in RollChoice])))
            elif key == "view":
                color_by = ColorBy(one(key, text, [v.value for v in ColorBy]))
                state = replace(state, map_view=replace(state.map_view, color_by=color_by))
            elif key in SWITCHES:
                state = changes.switched(state, **{SWITCHES[key]: one(key, text, ("0", "1")) == "1"})
            elif key not in ("h", "theta", "side") and not is_about_tasks(key):
                raise InputError("link", key, text, one_of(KEYS, key))
        return self._pick(changes.turn(state, turn))

    def _pick(self, state: State) -> State:
        if "h" not in self.settings:
            return state
        h, theta = (number(key, self.settings.get(key, "0")) for key in ("h", "theta"))
        profile = state.scene.profile
        inside = float(np.clip(h / 100, profile.h_min, profile.h_max))
        h = inside if abs(inside - h / 100) < ROUNDING else h / 100
        state = changes.choose(state, h, np.deg2rad(theta))
        if "side" not in self.settings or state.pick is None:
            return state
        sides = [f"{np.rad2deg(roll):.0f}" for roll in ROLLS]
        side = one("side", self.settings["side"], sides)
        return replace(state, pick=Pick(state.pick.h, state.pick.theta, sides.index(side)))


SWITCHES = {"board": "flat_map", "gizmo": "drag_handles", "dark": "dark"}
"""Key of a link → the switch of `Display` that it sets."""
KEYS = (
    "scene", "object", "hand.<arm>", "tasks", "arms.<task>", "at.<task>", "task", "arm", "turn", "roll",
    "view", *SWITCHES, "h", "theta", "side", "camera",
)  # fmt: skip


def link_of(state: State, served: Scene, camera: Camera | None = None) -> str:
    """Return what stands behind the ``?`` of the address that opens a state again.

    Args:
        state: what is shown.
        served: its scene as the server has it.
        camera: where it is looked at from.

    Raises:
        SymgraspError: something that was uploaded is shown, or the link would be too long to be read.
    """
    for what, uploaded in (
        ("scene", state.shown_upload),
        ("object", state.object_choice and state.object_choice.measurement),
    ):
        if uploaded:
            raise InputError("link", what, "an upload", "something the server has; save the scene instead")
    parts: dict[str, str] = {"scene": state.scene_name}
    if state.object_choice:
        parts["object"] = state.object_choice.option
    parts |= {f"hand.{arm}": hand for arm, hand in state.scene.replaceable_hands.items()}
    parts |= {"task": state.task, "arm": state.arm}
    parts |= tasks_text(state, served.tasks)
    optional: list[tuple[str, bool, Callable[[], str]]] = [
        ("turn", state.delta != 0, lambda: number_text(np.rad2deg(state.delta))),
        ("roll", state.map_view.roll is not RollChoice.EITHER, lambda: state.map_view.roll.value),
        ("view", state.map_view.color_by is not ColorBy.REASON, lambda: state.map_view.color_by.value),
        ("board", not state.display.flat_map, lambda: "0"),
        ("gizmo", state.display.drag_handles, lambda: "1"),
        ("dark", state.display.dark, lambda: "1"),
        ("camera", camera is not None, lambda: ",".join(f"{v:.3f}" for v in camera or ())),
    ]
    parts |= {key: text() for key, present, text in optional if present}
    if state.pick:
        parts |= {"h": number_text(100 * state.pick.h), "theta": number_text(np.rad2deg(state.pick.theta))}
        if state.pick.roll is not None:
            parts["side"] = f"{np.rad2deg(ROLLS[state.pick.roll]):.0f}"
    query = urlencode(parts, safe=",°")
    if len(query) > LONGEST:
        expected = f"at most {LONGEST} characters; save the scene instead"
        raise InputError("link", "length", len(query), expected)
    return query


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
        None if camera is None else tuple(numbers("camera", camera)),
        settings,
    )
