"""Names that would do something if they were taken for more than text."""

from __future__ import annotations

__all__ = ["HOSTILE_NAMES"]

HOSTILE_NAMES = {
    "broken formula": "$x^$",
    "formula": "$x^2$",
    "escaped formula": r"a\$b$ \frac{1}$",
    "image": "<img src=x onerror=alert(1)>",
    "script": "</script><script>alert(1)</script>",
    "terminal colour": "\x1b[31mred\x07",
    "line break": "two\nlines\r",
    "comment's end": "--> ]]> */ # &amp; &",
    "right to left": "\u202egnp.exe\u2066",
    "format": "%s %(name)s {0} {name}",
    "wide": "W" * 100,
    "emoji": "🍾👩\u200d🚀",
    "quotes": "'\"`",
    "hidden": "_underscore",
    "yaml": "- a: [1, *x]",
}
"""What they look like → a name of at most 100 characters."""
