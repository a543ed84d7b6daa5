"""Names and other texts of people in HTML."""

from __future__ import annotations

import html

from symgrasp.errors import printable

__all__ = ["escape"]


def escape(text: str) -> str:
    """Return a text as HTML shows it as it is: no markup, and no control that turns the text around it."""
    return html.escape(printable(text))
