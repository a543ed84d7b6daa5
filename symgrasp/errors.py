"""Every error this library raises on purpose.

An input error is one line that says where the bad value stands, what it is and what was
expected, so that the command line and the page can show it as it is.
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
    """A value that came from outside is not usable.

    Args:
        source: file name or object that holds the value.
        field: where in the source, in the notation of the file format.
        value: the offending value, shown shortened.
        expected: what would have been right.
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
        """Pickle what it was made of, not its text."""
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
    """A planner found nothing; the text says why."""


class Cancelled(SymgraspError):
    """Raised by a progress callback to stop a long computation."""


def one_of(choices: Iterable[str], wrong: object = None) -> str:
    """Return the phrase that lists the valid names, nearest to the wrong one first."""
    names = sorted(choices)
    near = get_close_matches(str(wrong), names, n=1)
    hint = f" (did you mean {near[0]!r}?)" if near else ""
    return "one of " + ", ".join(repr(n) for n in names) + hint
