"""Numbers of a scene by their paths, such as ``obstacles.table.pose.position.2``."""

from __future__ import annotations

from typing import Any

from symgrasp.errors import one_of

__all__ = ["keys_of", "with_number"]


def with_number(content: dict[str, Any], path: str, value: float) -> dict[str, Any]:
    """Return the content of a scene file with another number at a path.

    Args:
        content: plain data; it is not changed.
        path: keys, with points between them; entries of lists by their names or their numbers, from 0 on.
        value: the number.

    Raises:
        ValueError: there is no number at the path; says what is expected.
    """
    return _with(content, path.split("."), [], value)


def keys_of(content: dict[str, Any], path: str) -> tuple[str | int, ...]:
    """Return the keys of a path, entries of lists by their numbers: the same however the path is written.

    Args:
        content: plain data that has something there.
        path: see `with_number`.
    """
    at: Any = content
    found: list[str | int] = []
    for step in path.split("."):
        keys = _keys(at)
        found.append(keys[step])
        at = at[keys[step]]
    return tuple(found)


def _keys(at: Any) -> dict[str, Any]:
    """Return the keys of plain data by what paths call them."""
    if isinstance(at, dict):
        return {str(key): key for key in at}
    if isinstance(at, list | tuple):
        keys: dict[str, Any] = {str(k): k for k in range(len(at))}
        return keys | {e["name"]: k for k, e in enumerate(at) if isinstance(e, dict) and "name" in e}
    return {}


def _with(at: Any, steps: list[str], before: list[str], value: float) -> Any:
    if not steps:
        if isinstance(at, bool) or not isinstance(at, int | float):
            raise ValueError(f"the path of a number, which {'.'.join(before)} is not")
        return value
    step, *rest = steps
    keys = _keys(at)
    if step not in keys:
        where = ".".join(before) or "the scene"
        raise ValueError(f"in {where}, {one_of(keys, step)}" if keys else f"nothing in {where}, a number")
    changed = dict(at) if isinstance(at, dict) else list(at)
    changed[keys[step]] = _with(at[keys[step]], rest, [*before, step], value)
    return changed
