"""Where the object or the robot may stand: runs surveys in the background, and shows what they find."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import viser

from ..html.survey import places_html, run_html, stands_html
from ..state.state import State
from ..state.surveys.survey import SPACINGS, SurveyKind, SurveyState, SurveyValue
from ..state.surveys.survey_changes import change_survey, stand_at
from .actions import Actions
from .panel import Panel, slider_value

__all__ = ["KINDS", "VALUES", "SurveyPanel"]

KINDS: Mapping[str, SurveyKind] = {"the object": "object", "the robot": "robot"}
"""Label of what is moved → which it is."""

VALUES: Mapping[str, SurveyValue] = {
    "share that is feasible": "share", "largest margin": "margin", "a plan exists": "plan",
}  # fmt: skip
"""Label of what the colours stand for → which it is."""


class SurveyPanel(Panel):
    """Asks for a survey, shows it as a picture and in words, and puts the robot where it should stand."""

    def __init__(self, gui: viser.GuiApi, actions: Actions) -> None:
        super().__init__(gui, actions)
        self.title = self.html()
        self.kind = self.dropdown("Where to put", tuple(KINDS))
        self.on(self.kind, lambda s, v: change_survey(s, lambda own: replace(own, kind=KINDS[v])))
        self.spacings: dict[SurveyKind, viser.GuiSliderHandle[float]] = {
            kind: gui.add_slider("Spacing (cm)", 100 * low, 100 * high, 1, 100 * first)
            for kind, (low, high, first) in SPACINGS.items()
        }
        for kind, slider in self.spacings.items():
            self.on(slider, lambda s, v, kind=kind: change_survey(s, lambda own: _spaced(own, kind, v / 100)))
        self.run = self.button("Try all places", viser.Icon.GRID_DOTS, self._run_or_stop)
        self.progress = gui.add_progress_bar(0.0, visible=False)
        self.doing = self.html()
        self.value = self.dropdown("Colours", tuple(VALUES))
        self.on(self.value, lambda s, v: change_survey(s, lambda own: replace(own, value=VALUES[v])))
        self.picture = self.html()
        self.shown = gui.add_checkbox("Show in 3D", True)
        self.on(self.shown, lambda s, v: change_survey(s, lambda own: replace(own, shown=v)))
        self.stands = self.html()
        self.stand = gui.add_button_group("Stand at", ("1",), visible=False)

        @self.stand.on_click
        async def _(_: object) -> None:  # at once, while the value is that of this click
            index = int(self.stand.value) - 1
            actions.change(lambda s: stand_at(s, index))

        self._runs = False
        self.command("Survey: try all places", actions.surveys.run)
        self.command("Survey: stop", actions.surveys.stop)

    def _run_or_stop(self) -> None:
        surveys = self.actions.surveys
        (surveys.stop if self._runs else surveys.run)()

    def show(self, state: State) -> None:
        """Show how far the survey is, and what it has found."""
        survey = state.survey
        self._runs = survey.run is not None
        self.title.show(_title(state))
        for kind, slider in self.spacings.items():
            slider.visible = kind == survey.kind
        self.run.label = "Stop" if survey.run else "Try all places"
        self.run.icon = viser.Icon.X if survey.run else viser.Icon.GRID_DOTS
        self.progress.visible = survey.run is not None
        self.progress.value = 100 * survey.run.points / survey.run.of if survey.run and survey.run.of else 0.0
        self.doing.show(run_html(state))
        self.picture.show(places_html(state))
        self.stands.show(stands_html(state))
        stands = survey.stands if state.shown_places else ()
        self.stand.visible = bool(stands)
        options = tuple(str(k) for k in range(1, len(stands) + 1))
        if options and self.stand.options != options:
            self.stand.options = options

    def write_inputs(self, state: State) -> None:
        """Set what is asked for."""
        survey = state.survey
        for kind, slider in self.spacings.items():
            slider.value = slider_value(slider, 100 * survey.spacing[kind])
        self.kind.value = next(k for k, kind in KINDS.items() if kind == survey.kind)
        self.value.value = next(k for k, value in VALUES.items() if value == survey.value)
        self.shown.value = survey.shown


def _spaced(survey: SurveyState, kind: SurveyKind, spacing: float) -> SurveyState:
    return replace(survey, spacing={**survey.spacing, kind: spacing})


def _title(state: State) -> str:
    if state.survey.kind == "object":
        text = "Where can it be held? Moves the object over its plane, with nothing else changed."
    else:
        text = "Where should the robot stand? Moves its base, and plans all tasks from there."
    return f'<div class="sg sg-faint">{text}</div>'
