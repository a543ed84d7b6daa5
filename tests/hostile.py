"""Files that are made to break or to keep busy whatever reads them, for several tests."""

from __future__ import annotations

__all__ = ["chain_urdf", "doubling_yaml"]


def chain_urdf(links: int) -> str:
    """A robot whose links hang on each other in one chain."""
    names = "".join(f"<link name='l{i}'/>" for i in range(links))
    joints = "".join(
        f"<joint name='j{i}' type='continuous'><parent link='l{i - 1}'/><child link='l{i}'/></joint>"
        for i in range(1, links)
    )
    return f"<robot name='chain'>{names}{joints}</robot>"


def doubling_yaml(levels: int, *, merged: bool = False) -> str:
    """A document in which every line stands for nine times as many values as the one before."""
    lines = ["a0: &a0 {k: 1}" if merged else "a0: &a0 [1]"]
    for i in range(1, levels):
        nine = ",".join([f"*a{i - 1}"] * 9)
        lines.append(f"a{i}: &a{i} {{<<: [{nine}]}}" if merged else f"a{i}: &a{i} [{nine}]")
    return "\n".join(lines)
