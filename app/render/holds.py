"""At which heights of the object the hands of a task can hold it, by opening, palm and slope alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from symgrasp.feasibility.object_report import holding_heights
from symgrasp.object.profile import Profile
from symgrasp.robot.hand import Hand

from ..state.state import State
from .prints import hand_color

__all__ = ["HandHolds", "hand_holds"]


@dataclass(frozen=True)
class HandHolds:
    """Where a hand fits.

    Attributes:
        hand: its name.
        color: index of its colour in `app.render.palette.PRINTS`.
        spans: lowest and highest height (m) of each part of the object where it does.
    """

    hand: str
    color: int
    spans: tuple[tuple[float, float], ...]


def hand_holds(state: State) -> list[HandHolds]:
    """Return where each hand of the chosen task fits; hands of the same name are one."""
    found: dict[str, HandHolds] = {}
    for k, name in enumerate(state.scene.task(state.task).arms):
        hand = state.scene.arm(name).hand
        spans = _spans(hand, state.scene.profile)
        found.setdefault(hand.name, HandHolds(hand.name, hand_color(k), spans))
    return list(found.values())


@lru_cache(maxsize=64)
def _spans(hand: Hand, profile: Profile) -> tuple[tuple[float, float], ...]:
    return holding_heights(hand, profile)
