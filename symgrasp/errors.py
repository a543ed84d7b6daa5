"""All exceptions that this library raises on purpose.

The text of an input error is one line with the source of the bad value, the field, the value and what was
expected, so the command line and the page can show it unchanged.
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from reprlib import Repr

__all__ = [
    "Cancelled",
    "InputError",
    "MapError",
    "MeshError",
    "NoPlanError",
    "PlanError",
    "ProfileError",
    "SceneError",
    "SymgraspError",
    "UrdfError",
    "one_of",
]


_SHORT = Repr()
_SHORT.maxlevel, _SHORT.maxstring, _SHORT.maxother = 4, 120, 120
_SHORT.maxlist = _SHORT.maxtuple = _SHORT.maxdict = 8


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
        try:
            shown = _SHORT.repr(value)
        except ValueError:  # an integer of thousands of digits
            shown = f"a very large {type(value).__name__}"
        line = f"{self.source}: {field}: {shown}: expected {expected}"
        super().__init__(" ".join(line.split()))

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the arguments, because the default would pickle only the text."""
        return type(self), (self.source, self.field, self.value, self.expected)


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
    hint = f" (did you mean {similar[0]!r}?)" if similar else ""
    return "one of " + ", ".join(repr(n) for n in names) + hint
