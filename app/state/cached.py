"""Values of immutable objects that are computed when they are first needed."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, Self, TypeVar, overload

__all__ = ["cached"]

T = TypeVar("T")


class cached(Generic[T]):
    """A property that is computed once; like `functools.cached_property`, but nobody waits for others.

    Before Python 3.12, that one computes under a lock that all objects of a class have in common: every
    browser would wait for what is computed for another. Here two threads may compute a value at the same
    time, and one of the equal results is kept.
    """

    def __init__(self, compute: Callable[[Any], T]) -> None:
        self._compute, self._name = compute, ""
        self.__doc__ = compute.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...
    @overload
    def __get__(self, instance: object, owner: type) -> T: ...
    def __get__(self, instance: object | None, owner: type) -> Self | T:
        if instance is None:
            return self
        # Found there from now on; without __set__, an attribute of the object goes before this.
        return instance.__dict__.setdefault(self._name, self._compute(instance))
