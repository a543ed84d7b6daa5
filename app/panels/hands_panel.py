"""Several hands on one object: bimanual plans, handovers, and the replay of the hill climbing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import viser

from ..html.conflicts import failure_html
from ..html.hands import climb_comparison_html, hands_html
from ..html.readout import bimanual_html
from ..state.plans import plan_changes
from ..state.plans.plan_results import FIRST_SEED
from ..state.state import State
from .actions import Actions
from .panel import Panel

__all__ = ["HANDS_METHODS", "HandsPanel"]

HANDS_METHODS: Mapping[str, str] = {
    "widest gap (complete search)": "exact",
    "hill climbing (Algorithm 3)": "hill_climb",
}
"""Label of a method on the page → the method."""


class HandsPanel(Panel):
    """Plans for several arms, and shows their handprints on their maps."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        plans = actions.plans
        self.title = self.html()
        self.method = self.dropdown("Method", tuple(HANDS_METHODS))
        self.on(
            self.method,
            lambda s, v: plan_changes.change_plan_results(
                s, lambda results: replace(results, hands_method=HANDS_METHODS[v])
            ),
        )
        self.seed = gui.add_number("Seed", FIRST_SEED, min=0, max=2**31 - 1, step=1, visible=False)
        self.on(
            self.seed,
            lambda s, v: plan_changes.change_plan_results(s, lambda results: replace(results, seed=int(v))),
            "inputs",
        )
        self.run = self.button("All arms together", viser.Icon.USERS, lambda: plans.run("bimanual"))
        self.handover = self.button(
            "Hand over: all tasks in order",
            viser.Icon.ARROWS_EXCHANGE,
            lambda: plans.run("handover"),
            visible=False,
        )
        self.failure = self.html()
        self.comparison = self.html()
        self.frame = gui.add_slider("Climb", 1, 2, 1, 1, visible=False)
        self.on(self.frame, lambda s, v: plan_changes.show_frame(s, int(v) - 1), "scrub")
        self.replay = self.button(
            "Replay the climb",
            viser.Icon.PLAYER_PLAY,
            lambda: actions.change(plan_changes.play_climb),
            color="gray",
            visible=False,
        )
        self.maps = self.html()

    def show(self, state: State) -> None:
        """Show the maps with the handprints, or why there is no plan."""
        plan_results, climb = state.plan_results, state.plan_results.climb
        refusal = plan_results.refusal if plan_results.kind != "sequential" else None
        self.title.show(bimanual_html(state))
        self.run.disabled = not state.can_plan("bimanual")
        self.seed.visible = plan_results.hands_method == "hill_climb"
        self.handover.visible = state.can_plan("handover")
        self.failure.show(failure_html(refusal, state.scene.manifold) if refusal else "")
        self.comparison.show(climb_comparison_html(climb) if climb else "")
        self.frame.visible = climb is not None and len(climb.steps) > 1
        self.replay.visible = self.frame.visible
        if climb and self.frame.visible:
            self.frame.max = len(climb.steps)
        playing = plan_results.playing == "climb"
        self.replay.label = "Pause the climb" if playing else "Replay the climb"
        self.replay.icon = viser.Icon.PLAYER_PAUSE if playing else viser.Icon.PLAYER_PLAY
        self.maps.show(hands_html(state))

    def write_inputs(self, state: State) -> None:
        """Set method, seed and the step of the climb."""
        plan_results = state.plan_results
        self.method.value = next(
            k for k, method in HANDS_METHODS.items() if method == plan_results.hands_method
        )
        self.seed.value = plan_results.seed
        if plan_results.climb and len(plan_results.climb.steps) > 1:
            self.frame.value = (
                len(plan_results.climb.steps) if plan_results.frame is None else plan_results.frame + 1
            )
