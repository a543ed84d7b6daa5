"""Compiles what the tests need, once, before several processes of them would do so at the same time."""

from __future__ import annotations

import sys
from pathlib import Path

import symgrasp
from symgrasp.compiling import SOURCES
from symgrasp.feasibility.create import create_map
from symgrasp.motion.planning import plan_motion
from symgrasp.planners.planning import plan_bimanual, plan_sequential
from tests.conftest import PLAIN, load_small

__all__ = ["fingerprint"]


def fingerprint() -> str:
    """Return what the compiled code depends on: this Python, and the files that numba compares."""
    root = Path(symgrasp.__file__).parent
    files = [(path, path.stat()) for pattern in SOURCES for path in sorted(root.glob(pattern))]
    return repr([sys.version, [(str(path), stat.st_mtime_ns, stat.st_size) for path, stat in files]])


if __name__ == "__main__":
    for name in PLAIN:
        create_map(load_small(name, 4, 8, 2))
    create_map(load_small(PLAIN[0], 4, 8, 2).with_settings(redundancy="auto"), certify=True)
    sequence = load_small("pick_pour_place", 12, 24, 8)
    plan_motion(sequence, plan_sequential(sequence))
    plan_bimanual(load_small("log_two_robots", 20, 24, 6))
