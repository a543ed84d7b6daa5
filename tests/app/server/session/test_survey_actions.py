"""Surveys of the page run in the background: maps go before them, they can be stopped, and they end."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from app.state.surveys.survey import SPACINGS
from tests.app.server.session.served import Server, processes, start_server

pytestmark = pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection")


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with start_server() as server:
        yield server


def test_maps_go_before_a_survey_which_goes_on_until_it_is_stopped(server):
    with server.visit() as visitor:
        visitor.wait_for("Ready.")
        (session,) = server.lobby._sessions.values()
        visitor.set("Spacing (cm)", 100 * SPACINGS["object"][0])  # far more places than are waited for
        visitor.trigger("Survey: try all places")
        visitor.wait_for(" a second, ")
        visitor.set("x (cm)", 40.0)
        visitor.wait_for(lambda _: session.state.is_current and session.state.T_world_object[0, 3] == 0.4)
        before = session.state.survey.run
        assert before.points < before.of
        visitor.wait_for(lambda _: session.state.survey.run.points > before.points)
        visitor.trigger("Survey: stop")
        html = visitor.wait_for(lambda html: " a second, " not in html)
        assert "heat map of places of the object from above" in html  # what was found stays
        assert session.state.survey.run is None
        assert session.state.survey.problem == ""
        visitor.trigger("Survey: try all places")  # the process that was stopped does it
        visitor.wait_for(" a second, ")
    server.wait_until_empty()
    assert len(processes()) == 1  # the one that is kept for the next browser
