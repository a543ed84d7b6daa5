"""Values that are computed once, without waiting for those of other objects."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field

from app.state.cached import cached

WAIT = 30.0


@dataclass(frozen=True)
class Slow:
    begun: threading.Event = field(default_factory=threading.Event)
    go: threading.Event = field(default_factory=threading.Event)
    computed: list[int] = field(default_factory=list)

    @cached
    def value(self) -> int:
        """What takes long."""
        self.begun.set()
        assert self.go.wait(WAIT)
        self.computed.append(1)
        return len(self.computed)


def test_a_value_is_computed_once():
    slow = Slow()
    slow.go.set()
    assert (slow.value, slow.value) == (1, 1)
    assert slow.computed == [1]
    assert Slow.value.__doc__ == "What takes long."


def test_nobody_waits_for_the_value_of_another_object():
    slow, quick = Slow(), Slow()
    thread = threading.Thread(target=lambda: slow.value)
    thread.start()
    assert slow.begun.wait(WAIT)
    quick.go.set()
    done = threading.Thread(target=lambda: quick.value, daemon=True)
    done.start()
    done.join(WAIT)
    assert quick.computed == [1]  # while the other one is still computed
    assert slow.computed == []
    slow.go.set()
    thread.join(WAIT)
    assert slow.value == 1
