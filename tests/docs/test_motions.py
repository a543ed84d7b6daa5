"""What docs/motions.md says is what the benchmark measured."""

from __future__ import annotations

import json

from docs.motions import BEGIN, END, MEASURED, PAGE, table


def test_the_page_says_what_was_measured():
    """What fails here is mended by ``python -m docs.motions``."""
    content = json.loads(MEASURED.read_text(encoding="utf-8"))
    text = PAGE.read_text(encoding="utf-8")
    assert text.split(BEGIN)[1].split(END)[0].strip() == table(content).strip()
