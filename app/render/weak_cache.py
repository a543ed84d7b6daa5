"""What was made from a map or scene is kept as long as that lives, and keeps neither alive."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

__all__ = ["cached_with_first"]

K = TypeVar("K", bound=Hashable)
P = ParamSpec("P")
T = TypeVar("T")


def cached_with_first(make: Callable[Concatenate[K, P], T]) -> Callable[Concatenate[K, P], T]:
    """Let a function remember what it returned for as long as its first argument lives.

    `functools.lru_cache` would keep the maps of closed pages. What is returned must not refer to the
    first argument; the others are given by position. Threads at once may make the same twice.
    """
    kept: WeakKeyDictionary[K, dict[object, T]] = WeakKeyDictionary()

    @wraps(make)
    def look_up(first: K, *args: P.args, **options: P.kwargs) -> T:
        assert not options
        known = kept.setdefault(first, {})
        if args not in known:
            known[args] = make(first, *args, **options)
        return known[args]

    return look_up
