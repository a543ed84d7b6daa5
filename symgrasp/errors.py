"""All exceptions that this library raises on purpose.

The text of an input error is one line with the source of the bad value, the field, the value and what was
expected, so the command line and the page can show it unchanged. What files and people call things goes
through `printable` before it is shown, because names may hold anything.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from itertools import islice
from numbers import Integral, Real
from pathlib import Path

__all__ = [
    "LONGEST",
    "Cancelled",
    "InputError",
    "MapError",
    "MeshError",
    "NoPlanError",
    "PlanError",
    "ProfileError",
    "SceneError",
    "SurveyError",
    "SymgraspError",
    "UrdfError",
    "as_written",
    "one_of",
    "printable",
    "referred_to",
    "shortened",
]

LONGEST = 280
"""Most characters of an input error's text."""

_KEPT = 40
"""Characters of a source, a field and a value that a long text of what was expected leaves."""

_AMOUNT = re.compile(r"[\d.,]+ [^\W\d_][^'\"]*")
"""A number with its unit."""

_DEEPEST, _MOST_ENTRIES, _LONGEST_TEXT = 4, 8, 120
"""Levels, entries of a level, and characters of a text that a value is shown with."""


class SymgraspError(Exception):
    """Root of all errors of this library."""


class InputError(SymgraspError, ValueError):
    """A value from a file or a caller is unusable.

    Args:
        source: file name or object that holds the value.
        field: where in the source, in the notation of the file format.
        value: the bad value; the text shows it shortened.
        expected: what a good value would be.
    """

    def __init__(self, source: object, field: str, value: object, expected: str) -> None:
        self.source = str(source)
        self.field = field
        self.value = value
        self.expected = expected
        super().__init__(_line(self.source, *self._parts()))

    @property
    def without_source(self) -> str:
        """The text for where the source has been named already."""
        return _line(*self._parts())

    def _parts(self) -> tuple[str, str, str]:
        return self.field, _shown(self.value), f"expected {self.expected}"

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the arguments, because the default would pickle only the text."""
        return type(self), (self.source, self.field, self.value, self.expected)


@contextmanager
def referred_to(source: object, field: str) -> Iterator[None]:
    """Say of input errors of a file also where another file refers to it.

    Args:
        source: the file that refers to it.
        field: where in that.
    """
    try:
        yield
    except InputError as error:
        where = f"{field}: {Path(error.source).name}: {error.field}"
        raise type(error)(source, where, error.value, error.expected) from error


class ProfileError(InputError):
    """A radius profile, or a height asked of it, is unusable."""


class MeshError(InputError):
    """A mesh file is missing or unusable."""


class UrdfError(InputError):
    """A robot description is missing or unusable."""


class SceneError(InputError):
    """A scene file is missing or unusable."""


class MapError(InputError):
    """A stored feasibility map is missing or unusable."""


class PlanError(InputError):
    """A stored plan is missing or unusable."""


class SurveyError(InputError):
    """A survey, or a store of its results, is missing or unusable."""


class NoPlanError(SymgraspError):
    """A planner found no plan; the text says why."""


class Cancelled(SymgraspError):
    """Raised by a progress callback to stop a long computation."""


def one_of(choices: Iterable[str], wrong: object = None) -> str:
    """Return the phrase that lists the valid names, with the one closest to a misspelled name as a hint.

    Args:
        choices: the valid names.
        wrong: the name that was given; None gives no hint.
    """
    names = sorted(choices)
    similar = get_close_matches(str(wrong), names, n=1)
    hint = f" (did you mean {as_written(similar[0])}?)" if similar else ""
    return "one of " + ", ".join(map(as_written, names)) + hint


def printable(text: str) -> str:
    """Return a text with everything that is not to be seen as an escape: no control takes effect anywhere.

    Such are line breaks, the escape sequences of terminals, and marks that reverse the direction of writing.
    """
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def shortened(text: str, most: int) -> str:
    """Return a text of at most ``most`` characters: a longer one without its middle."""
    if len(text) <= most:
        return text
    tail = (most - 1) // 2
    return text[: most - 1 - tail] + "…" + text[len(text) - tail :]


def as_written(value: object, level: int = 0) -> str:
    """Return a value as the file formats write it, on one line: null, true, [a list], {a: mapping}, 'a text'.

    Long texts, long lists and what is nested deeply are shortened.

    Args:
        value: plain data, or what stands for it: tuples and sets are lists, paths are texts.
        level: how deeply it is nested in what is written.
    """
    if value is None or isinstance(value, bool):
        return "null" if value is None else str(value).lower()
    if isinstance(value, Mapping | list | tuple | set | frozenset) and level == _DEEPEST and value:
        return "{…}" if isinstance(value, Mapping) else "[…]"
    if isinstance(value, Mapping):
        pairs = [
            f"{key if _is_plain(key) else as_written(key, level + 1)}: {as_written(own, level + 1)}"
            for key, own in islice(value.items(), _MOST_ENTRIES)
        ]
        return "{" + ", ".join(pairs + ["…"] * (len(value) > _MOST_ENTRIES)) + "}"
    if isinstance(value, list | tuple | set | frozenset):
        entries = sorted(value, key=str) if isinstance(value, set | frozenset) else value
        texts = [as_written(own, level + 1) for own in islice(entries, _MOST_ENTRIES)]
        return "[" + ", ".join(texts + ["…"] * (len(value) > _MOST_ENTRIES)) + "]"
    if isinstance(value, Real):
        return _number(value)
    text = shortened(str(value), _LONGEST_TEXT)
    if "'" in text and '"' not in text and "\\" not in text:
        return f'"{text}"'
    return "'" + text.replace("'", "''") + "'"


def _is_plain(key: object) -> bool:
    """Whether a key needs no quotes."""
    return isinstance(key, str) and re.fullmatch(r"\w[\w. -]*", key) is not None


def _number(value: Real) -> str:
    if isinstance(value, Integral):
        try:
            return str(int(value))
        except ValueError:  # of thousands of digits
            return "a very large number"
    number = float(value)
    if math.isfinite(number):
        text = repr(number)
        return text if "." in text else text.replace("e", ".0e")  # YAML knows no 1e-9
    return ".nan" if math.isnan(number) else ".inf" if number > 0 else "-.inf"


def _shown(value: object) -> str:
    """Return a value as people say it: as files have it, amounts and what is not there in words."""
    if value is None:
        return "nothing"
    if isinstance(value, (list, tuple, dict)) and not value:
        return "an empty mapping" if isinstance(value, dict) else "an empty list"
    if isinstance(value, str) and _AMOUNT.fullmatch(value):
        return value
    return as_written(value)


def _line(*parts: str) -> str:
    """Join parts to a line of at most `LONGEST` characters.

    The longest parts are shortened, and the last one, which says what to do, only when the others are short.
    """
    *before, last = (printable(" ".join(part.split())) for part in parts)
    room = LONGEST - len(": ") * len(before)
    last = shortened(last, room - sum(min(len(part), _KEPT) for part in before))
    room -= len(last)
    most = next(n for n in range(room, 0, -1) if sum(min(len(part), n) for part in before) <= room)
    return ": ".join([*(shortened(part, most) for part in before), last])
