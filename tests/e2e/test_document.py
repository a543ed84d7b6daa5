"""The document that plays a plan's motion, opened from the disk by a browser without a network."""

from __future__ import annotations

import io
from itertools import pairwise
from pathlib import Path

import numpy as np
from PIL import Image
from playwright.sync_api import Browser, expect

from symgrasp.motion.exports import to_html
from tests.e2e.page import HARMLESS, WAIT
from tests.motion.recorded import recorded_motion, recorded_plan

SCREENSHOTS = Path(__file__).parent / "screenshots"


def test_the_document_plays_without_a_network(browser: Browser, tmp_path: Path):
    path = tmp_path / "plan.html"
    path.write_text(to_html(recorded_plan()), encoding="utf-8")
    context = browser.new_context(viewport={"width": 1000, "height": 650}, offline=True)
    page = context.new_page()
    page.set_default_timeout(WAIT)
    asked, complaints = [], []
    page.on("request", lambda request: asked.append(request.url))
    page.on("console", lambda m: complaints.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto(path.as_uri())
    expect(page).to_have_title("pick_pour_place · symgrasp")
    time = page.locator("input").first  # of the player, in seconds; it begins to play by itself
    expect(time).not_to_have_value("")

    def view(when: float) -> np.ndarray:
        """Return the picture at a time (s) of the motion, once it has passed."""
        page.wait_for_function("when => parseFloat(document.querySelector('input').value) >= when", arg=when)
        return np.asarray(Image.open(io.BytesIO(page.locator("canvas").first.screenshot())).convert("RGB"))

    end = recorded_motion().duration
    pictures = [view(share * end) for share in (0.1, 0.4, 0.7)]
    for before, after in pairwise(pictures):
        moved = np.abs(after.astype(int) - before).max(axis=-1) > 40
        assert moved.mean() > 0.003, "the arm and the bottle are elsewhere"
    SCREENSHOTS.mkdir(exist_ok=True)
    page.screenshot(path=SCREENSHOTS / "document.png")
    assert [url for url in asked if not url.startswith(("file:", "data:", "blob:"))] == []
    assert [c for c in complaints if not any(text in c for text in HARMLESS)] == []
    context.close()
