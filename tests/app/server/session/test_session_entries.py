"""What people enter, in any order and at any moment, is what the page and its links show."""

from __future__ import annotations

import asyncio
import logging
import random
import threading
from html import escape

import pytest

from app.compute.job_queue import JobQueue
from app.panels.pose_panel import PosePanel
from app.panels.status_panel import StatusPanel
from app.server.session.session import Session
from tests.app.server.session.served import (
    entered,
    legend,
    link_in,
    picture,
    ready,
    tasks,
    title,
    wait_until_alike,
)

pytestmark = pytest.mark.filterwarnings("ignore:Queued a .* on a closed connection")


def test_what_is_entered_while_the_page_writes_its_inputs_stays_entered(server, monkeypatch):
    begun, moved = threading.Event(), threading.Event()
    show, change = StatusPanel.show, Session.change

    def noted(session, *arguments):
        change(session, *arguments)
        if session.state and session.state.base.x == 0.53:
            moved.set()

    def slow(panel, state):
        """Draw the object that was put back only when it has been moved once more."""
        if state.base.x == 0.55:
            begun.set()
            assert moved.wait(30)
        show(panel, state)

    monkeypatch.setattr(Session, "change", noted)
    with server.visit() as visitor:
        visitor.wait_for(ready)
        visitor.set("x (cm)", 51.0)
        visitor.wait_for_quiet()
        monkeypatch.setattr(StatusPanel, "show", slow)
        visitor.trigger("Put the object back")
        assert begun.wait(30)
        visitor.set("x (cm)", 53.0)
        assert moved.wait(30)
        visitor.wait_for_quiet()
        visitor.wait_for(ready)
        assert entered(visitor, "x (cm)") == [53.0]


def test_what_a_person_asks_for_in_two_ways_at_once_leaves_nothing_half_begun(server, monkeypatch):
    """A button is heard in a thread of viser's pool, a slider on its loop."""
    submit, asked, overtaken = JobQueue.submit, threading.Event(), threading.Event()

    def slow(queue, job):
        """Give the plan to the queue only when the map has overtaken it, if it can."""
        in_pool = threading.current_thread().name.startswith("ThreadPool")
        if in_pool and not asked.is_set():
            asked.set()
            overtaken.wait(1)
        submit(queue, job)
        if not in_pool:
            overtaken.set()

    with server.visit() as visitor:
        first = picture(visitor.wait_for(ready))
        monkeypatch.setattr(JobQueue, "submit", slow)
        visitor.trigger("Plan one grasp for all tasks")
        assert asked.wait(30)
        visitor.set("x (cm)", 47.5)
        visitor.wait_for(lambda html: picture(html) != first and ready(html))


def test_what_a_person_enters_is_never_overwritten_before_it_is_read(server, monkeypatch):
    """viser stores an entered value and reads it in one step of its event loop; inputs are written there."""
    write, loops = PosePanel.write_inputs, []

    def recorded(panel, state):
        loops.append(asyncio.get_running_loop())  # raises on any other thread
        write(panel, state)

    monkeypatch.setattr(PosePanel, "write_inputs", recorded)
    with server.visit() as visitor:
        visitor.wait_for(ready)
        visitor.trigger("Put the object back")
        visitor.wait_for_quiet()
    assert loops
    assert set(loops) == {loops[0]}


CHOICES = {
    "Rotation (°)": [-120.0, 0.0, 15.25, 90.0],
    "x (cm)": [40.0, 50.0, 55.0],
    "z (cm)": [0.0, 10.0],
    "Lean (°)": [0.0, 20.0],
    "h (cm)": [2.0, 10.0, 99.0],
    "θ (°)": [-170.0, 0.0, 60.0],
    "Roll": ["either", "0°", "180°"],
    "Flat map": [True, False],
    "Drag handles": [True, False],
    "Colours show": ["reason", "feasible", "clearance"],
    "Dark": [True, False],
    "Object": ["the scene's own", "wine_bottle"],
    "Task": ["pick", "pour", "place"],
    "Undo": None,
    "Redo": None,
    "Put it back": [True],
    "Let go": [True],
    "Cancel": [True],
    "One grasp for all tasks": [True],
    "Scene": ["bottle_on_table", "pick_pour_place"],
}


@pytest.mark.random_walk
@pytest.mark.parametrize("seed", range(3))
def test_hundreds_of_random_actions_end_in_the_picture_that_a_fresh_page_shows(server, caplog, seed):
    caplog.set_level(logging.ERROR)
    chance = random.Random(seed)
    with server.visit() as visitor:
        visitor.wait_for(ready)
        for _ in range(150):
            label = chance.choice(list(CHOICES))
            if CHOICES[label] is None:
                visitor.trigger(label)
            elif any(w.get("label") == label for w in visitor.widgets.values()):
                visitor.set(label, chance.choice(CHOICES[label]))
            if chance.random() < 0.2:
                visitor.wait_for(lambda html: bool(picture(html)))
        visitor.wait_for_quiet()
        visitor.set("x (cm)", 53.0)  # also ends whatever is being planned or was cancelled
        visitor.wait_for_quiet()
        visitor.set("h (cm)", 10.0)
        visitor.wait_for(lambda html: ready(html) and "h = 10 cm" in html)
        visitor.trigger("Make a link")
        made = visitor.wait_for('class="sg-link"')
        with server.visit(link_in(made)) as fresh:
            fresh.wait_for(lambda html: ready(html) and "h = 10 cm" in html)
            wait_until_alike(visitor, fresh, picture, title, legend)
    assert caplog.records == []


def test_a_link_opens_the_tasks_that_a_person_made(server):
    name = "<b>tilt</b>, pour & ✓"
    with server.visit() as visitor:
        visitor.wait_for(ready)
        visitor.set("Rotation (°)", 20.0)
        visitor.trigger("Add a task after this one")
        visitor.wait_for(lambda _: any(w.get("value") == "task 2" for w in visitor.widgets.values()))
        visitor.set("Task name", name)
        visitor.set("Chosen task", "Rename")
        visitor.wait_for(escape(name))
        visitor.set("Chosen task", "Earlier")
        visitor.wait_for(f"1 · {escape(name)}")
        visitor.set("x (cm)", 52.0)
        visitor.set("Object", "wine_bottle")  # the tasks stay
        visitor.wait_for(lambda html: ready(html) and "the wine" in html)
        visitor.trigger("Make a link")
        made = visitor.wait_for('class="sg-link"')
        assert "has changed since" not in made
        assert escape(name) in tasks(made)
        with server.visit(link_in(made)) as fresh:
            fresh.wait_for(lambda html: ready(html) and escape(name) in tasks(html))
            wait_until_alike(visitor, fresh, tasks, title, picture)
        visitor.look_from(2.0, 1.5, 1.0)
        visitor.wait_for("The page has changed since")
