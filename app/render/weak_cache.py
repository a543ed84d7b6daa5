"""A cache for functions of a map, scene or state that does not keep its arguments alive."""

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
    """Decorate a function to cache its results until its first argument is garbage-collected.

    `functools.lru_cache` would keep the maps of closed pages in memory. A result must not refer to the
    first argument, which would then never be collected. Arguments are passed by position. Two threads
    that call at the same time may both compute.
    """
    cache: WeakKeyDictionary[K, dict[object, T]] = WeakKeyDictionary()

    @wraps(make)
    def look_up(first: K, *args: P.args, **options: P.kwargs) -> T:
        assert not options
        results = cache.setdefault(first, {})
        if args not in results:
            results[args] = make(first, *args, **options)
        return results[args]

    return look_up
