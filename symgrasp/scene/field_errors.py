"""What is wrong with a field of a file, in the words of the file formats instead of Python's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import ValidationError

__all__ = ["describe_error"]

EXPECTED: Mapping[str, str] = {
    **dict.fromkeys(("model_type", "model_attributes_type", "dict_type", "mapping_type"), "a mapping"),
    **dict.fromkeys(("list_type", "tuple_type"), "a list"),
    **dict.fromkeys(("bool_type", "bool_parsing"), "true or false"),
    **dict.fromkeys(("float_type", "float_parsing"), "a number"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "a whole number"),
    "string_type": "a text",
}
"""Type of pydantic's error → what was expected, in the words of the file formats instead of Python's."""


def describe_error(error: ValidationError, content: Any) -> tuple[str, object, str]:
    """Describe the first problem that pydantic found, for `InputError`.

    Args:
        error: what pydantic raised.
        content: the content that it validated.

    Returns:
        The field, its value, and what was expected.
    """
    first, *others = error.errors(include_url=False)
    if others and first["type"] == "string_type" and isinstance(first["input"], dict):
        first = others[0]  # what may be a text or a mapping is a mapping, in which this is wrong
    # pydantic's location also names members of unions; steps that do not lead into the content are skipped.
    path: list[str | int] = []
    at = content
    for step in first["loc"]:
        try:
            at = at[step]
        except (KeyError, IndexError, TypeError):
            if not (first["type"] == "missing" and step == first["loc"][-1]):
                continue
        path.append(step)
    field = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in path).lstrip(".")
    if first["type"] == "extra_forbidden":
        return field, first["input"], "a key of the file format; check its spelling"
    if first["type"] == "missing":
        return field, None, "a value; this key is required"
    if first["type"] == "too_long":
        return (
            field,
            f"{len(first['input']):,} of them",
            f"at most {first.get('ctx', {})['max_length']:,} of them",
        )
    if first["type"] == "too_short":
        return field, first["input"], f"at least {first.get('ctx', {})['min_length']} of them"
    expected = EXPECTED.get(first["type"])
    expected = expected or first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    return field or "file", first["input"], expected
