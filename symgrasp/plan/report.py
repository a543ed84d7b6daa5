"""What was found when a plan was checked."""

from __future__ import annotations

from dataclasses import dataclass, field

__all__ = ["Report"]


@dataclass
class Report:
    """What was checked, and what does not hold.

    Attributes:
        strict: whether no number may be overstated at all, not even by what rounding could explain.
        checks: how many single statements were checked.
        failures: one line for each that does not hold, with the numbers.
    """

    strict: bool = False
    checks: int = 0
    failures: list[str] = field(default_factory=list)

    @property
    def holds(self) -> bool:
        """Whether every statement holds."""
        return self.checks > 0 and not self.failures

    def __bool__(self) -> bool:
        """Whether every statement holds, so that a report can be asserted."""
        return self.holds

    def __str__(self) -> str:
        """One line a failure, and one that sums up."""
        result = "the plan holds" if self.holds else f"{len(self.failures)} do not hold"
        return "\n".join([*self.failures, f"{self.checks} statements checked: {result}"])

    def expect(self, ok: object, failure: str) -> bool:
        """Note one statement; ``failure`` says what is wrong where it does not hold."""
        self.checks += 1
        if not ok:
            self.failures.append(failure)
        return bool(ok)

    def at_most(self, stated: float, real: float, tolerance: float, failure: str) -> bool:
        """Note that a number is not overstated, by more than a tolerance unless the report is strict."""
        return self.expect(stated <= real + (0.0 if self.strict else tolerance), failure)
