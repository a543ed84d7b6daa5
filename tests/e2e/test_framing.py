"""A page from elsewhere cannot show this one inside itself, and a real browser's files are limited."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, expect

from tests.e2e.other_host import served


@pytest.fixture
def foreign_page(start_server) -> Iterator[str]:
    """The address of a page on another host that shows the server's in a frame."""
    address = start_server("bottle_on_table")
    html = f'<iframe src="{address}" onload="document.title=\'loaded\'">'
    with served(html, "127.0.0.2", "127.0.0.2") as other:
        yield other


def test_the_page_is_not_shown_inside_another(browser: Browser, foreign_page: str):
    context = browser.new_context()
    try:
        page = context.new_page()
        refused: list[int] = []
        sockets: list[str] = []
        page.on("response", lambda response: refused.append(response.status))
        page.on("websocket", lambda websocket: sockets.append(websocket.url))
        page.goto(foreign_page)
        expect(page).to_have_title("loaded")
        assert refused == [200, 403]
        assert sockets == []
    finally:
        context.close()


def test_a_file_that_is_too_large_is_refused_and_the_next_one_is_taken(open_page, tmp_path):
    page = open_page()
    large, empty = tmp_path / "large.stl", tmp_path / "empty.stl"
    large.write_bytes(bytes(20_000_001))
    empty.write_bytes(b"")
    chooser = page.frame.locator("input[type=file]").nth(1)  # that of "Upload a mesh"
    chooser.set_input_files(large)
    expect(page.alerts).to_contain_text("large.stl: size of the file")
    expect(page.alerts).to_contain_text("expected a file of at most 20 MB")
    expect(page.text("Uploading large.stl")).to_have_count(0)
    chooser.set_input_files(empty)
    expect(page.alerts).to_contain_text("empty.stl")
    assert page.complaints == []
