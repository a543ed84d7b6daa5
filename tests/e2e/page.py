"""The page as a person uses it: what is seen, and what can be done."""

from __future__ import annotations

import base64
import io
import json
import re
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from playwright.sync_api import Frame, Locator, Page, WebSocket, expect

from app.panels.layout import panels_width
from app.render.palette import rgb
from app.scene3d.viewpoint import FIELD_OF_VIEW, Viewpoint, choose_viewpoint
from app.server.door.front_door import MAP
from symgrasp.reason import Reason
from symgrasp.scene.scene import Scene
from tests.app.shown_map import ShownMap

WAIT = 30_000
"""Longest wait (ms) for anything: the machine may be busy."""

PACE = 80
"""Time (ms) a key is held, and between two keys."""

TRIES = 3
"""How often a number is typed until the box shows it."""

HIDE_NOTICE = """() => {
    for (const notice of document.querySelectorAll('.mantine-Notification-root[style*="orange"]'))
        notice.style.visibility = "hidden";
}"""
"""Hides viser's notice of slow drawing, which lies over the 3D view until it goes by itself."""

MAP_SHARE = 1.5e-4
"""Share of the 3D view that has the colour of feasible cells at least, when the map is in it."""

expect.set_options(timeout=WAIT)

HARMLESS = (
    "THREE.Clock",
    "ReadPixels",
    "KHR_parallel_shader_compile",
    "GPU stall",
    # viser's sorter of Gaussian splats, which the page has none of, asks for more than it is allowed.
    "'unsafe-eval' is not an allowed source of script",
)


class GraspPage:
    """One browser on the page.

    Args:
        page: an empty page of the browser.
        address: the server.
        wait_for_map: whether to wait until the first map is there.
    """

    def __init__(self, page: Page, address: str, wait_for_map: bool = True) -> None:
        self.page = page
        self.complaints: list[str] = []
        self.shown_map = ShownMap()
        page.set_default_timeout(WAIT)
        page.on("websocket", self._listen)
        page.on("console", lambda message: self._note(message.text if message.type == "error" else ""))
        page.on("pageerror", lambda error: self._note(str(error)))
        page.goto(address)
        if wait_for_map:
            expect(page.locator("#nothing")).to_be_hidden()

    def _note(self, complaint: str) -> None:
        if complaint and not any(text in complaint for text in HARMLESS):
            self.complaints.append(complaint)

    def _listen(self, websocket: WebSocket) -> None:
        if MAP in websocket.url:
            websocket.on("framereceived", self._take)

    def _take(self, message: bytes | str) -> None:
        assert isinstance(message, bytes)
        self.shown_map.take(message)

    @property
    def frame(self) -> Frame:
        """viser's part of the page; a file has no other."""
        return self.page.frame(name="view") or self.page.main_frame

    # -- what is seen -----------------------------------------------------------------------

    @property
    def map(self) -> Locator:
        return self.page.get_by_test_id("map")

    @property
    def alerts(self) -> Locator:
        return self.frame.get_by_role("alert").filter(visible=True).and_(self.frame.locator(".sg-note"))

    def text(self, text: str | re.Pattern[str]) -> Locator:
        """What is seen of a text; tabs that were looked at before are still there, out of sight."""
        return self.frame.get_by_text(text).filter(visible=True)

    def around(self, text: str) -> Locator:
        """What is seen of a text around the map."""
        return self.page.locator("#pane").get_by_text(text).filter(visible=True)

    @property
    def legend(self) -> Locator:
        return self.page.locator("#legend")

    def expect_title(self, text: str) -> None:
        """Wait for the map of that scene, task or arm, up to date."""
        title = self.page.locator("#title")
        expect(title).to_contain_text(text)
        expect(title).to_have_attribute("aria-busy", "false")
        expect(self.text("Ready.")).to_be_visible()

    def picture(self, alt: str = "map") -> np.ndarray:
        """Return a picture that is shown: (H, W, 3)."""
        if alt == "map":
            shown = self.shown_map.picture()
            assert shown is not None
            return shown
        return decode(self.frame.locator(f"img[alt='{alt}']").get_attribute("src") or "")

    def wait_for_picture(self, right: Callable[[np.ndarray], bool]) -> np.ndarray:
        """Wait until the map's picture is right."""
        deadline = time.monotonic() + WAIT / 1000
        while (picture := self.shown_map.picture()) is None or not right(picture):
            assert time.monotonic() < deadline, "the map never became right"
            self.next_frame()
        return picture

    def next_frame(self) -> None:
        """Wait until the page has drawn again."""
        self.page.evaluate("() => new Promise(done => requestAnimationFrame(done))")

    def view(self) -> np.ndarray:
        """Return the 3D view between the panels: (H, W, 3)."""
        self.frame.evaluate(HIDE_NOTICE)
        png = self.frame.locator("canvas").first.screenshot()
        return np.asarray(Image.open(io.BytesIO(png)).convert("RGB"))

    def wait_for_view(self, right: Callable[[np.ndarray], bool]) -> np.ndarray:
        """Wait until the 3D view is right, looking again at later frames."""
        for _ in range(100):
            view = self.view()
            if right(view):
                return view
            self.next_frame()
        raise AssertionError("the 3D view never became right")

    def settled_view(self) -> np.ndarray:
        """Wait until the map's colours are in the 3D view and nothing in it moves any more."""
        seen: list[np.ndarray] = []

        def still(view: np.ndarray) -> bool:
            seen.append(view)
            green = np.abs(view.astype(int) - rgb(Reason.FEASIBLE.color)).max(axis=-1) < 25
            return (
                green.mean() > MAP_SHARE and len(seen) > 4 and all(np.array_equal(view, v) for v in seen[-4:])
            )

        return self.wait_for_view(still)

    def wait_for_change(self, before: np.ndarray, share: float = 0.01) -> None:
        """Wait until so much of the 3D view looks different."""
        self.wait_for_view(lambda v: (np.abs(v.astype(int) - before).max(axis=-1) > 40).mean() > share)

    # -- what can be done -------------------------------------------------------------------

    def button(self, name: str) -> Locator:
        return self.frame.get_by_role("button", name=name, exact=True)

    def tab(self, name: str) -> None:
        self.frame.get_by_role("tab", name=name, exact=True).click()

    def choose(self, label: str, option: str) -> None:
        self.frame.get_by_label(label, exact=True).filter(visible=True).click()
        self.frame.get_by_role("option", name=option, exact=True).click()

    def upload(self, path: Path) -> None:
        with self.page.expect_file_chooser() as chooser:
            self.button("Upload a mesh").click()
        chooser.value.set_files(path)

    def number(self, label: str, value: float) -> None:
        self._enter(self.frame.get_by_label(label, exact=True), value)

    def slide(self, label: str, value: float) -> None:
        """Set a slider through its number box; arrow keys would turn the camera as well."""
        self._enter(self.slider_box(label), value)

    def _enter(self, box: Locator, value: float) -> None:
        """Type a number over the one in a box.

        By keys: the box looks where the caret was when one went down, to tell what is new in it, and may
        lose a text that comes without any. At a person's pace: it sends one change in 50 ms, and a change
        of the next box would take the place of one that waits. Again where the page wrote into the box
        meanwhile, as a person would who sees it.
        """
        typed = f"{value:g}"
        for _ in range(TRIES):
            box.press("ControlOrMeta+a")
            box.press_sequentially(typed, delay=PACE)
            if box.input_value() == typed:
                break
        box.press("Enter", delay=PACE)

    def slider_box(self, label: str) -> Locator:
        row = self.frame.locator(f"xpath=//*[normalize-space(text())='{label}']/ancestor::*[.//input][1]")
        return row.locator("input").filter(visible=True).last

    @property
    def aspect(self) -> float:
        """Ratio of width to height of the 3D view beside the panels."""
        size = self.page.locator("#view").bounding_box()
        assert size
        return (size["width"] - panels_width(round(size["width"]))) / size["height"]

    def viewpoint(self, scene: Scene) -> Viewpoint:
        """Return where the page looks at a scene from at first."""
        return choose_viewpoint(scene, scene.task().T_world_object, aspect=self.aspect)

    def at(self, scene: Scene, point: np.ndarray) -> tuple[float, float]:
        """Return the pixel of a point (3,) of the world, seen from where the page looks at first."""
        box = self.frame.locator("canvas").first.bounding_box()
        assert box
        camera = np.array(self.viewpoint(scene).camera(self.aspect))
        eye, forward = camera[:3], (camera[3:] - camera[:3]) / np.linalg.norm(camera[3:] - camera[:3])
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        up = np.cross(right, forward)
        x, y, depth = np.stack([right, up, forward]) @ (point - eye)
        scale = box["height"] / 2 / np.tan(FIELD_OF_VIEW / 2) / depth
        return box["x"] + box["width"] / 2 + scale * x, box["y"] + box["height"] / 2 - scale * y

    def click_3d(self, scene: Scene, point: np.ndarray) -> None:
        """Click a point of the world in the 3D view."""
        self.page.mouse.click(*self.at(scene, point))

    def drag_3d(self, scene: Scene, start: np.ndarray, end: np.ndarray) -> None:
        """Drag what is at a point of the world to another."""
        mouse = self.page.mouse
        mouse.move(*self.at(scene, start - 0.02 * (end - start)))
        self.settled_view()
        mouse.move(*self.at(scene, start))
        self.settled_view()  # the handle has noticed the pointer
        mouse.down()
        for share in np.linspace(0, 1, 6):
            mouse.move(*self.at(scene, start + share * (end - start)))
            self.view()
        mouse.up()

    def download_plan(self, to: Path) -> dict[str, Any]:
        with self.page.expect_download() as download:
            self.button("Download plan").click()
        path = to / download.value.suggested_filename
        download.value.save_as(path)
        return json.loads(path.read_text(encoding="utf-8"))


def decode(source: str) -> np.ndarray:
    """Decode a PNG data URI: (H, W, 3)."""
    data = base64.b64decode(source.removeprefix("data:image/png;base64,"))
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))
