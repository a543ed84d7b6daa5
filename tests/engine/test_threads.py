"""Maps run on threads of Python; those of numba, which may spin while they wait, never start."""

from __future__ import annotations

import subprocess
import sys
import threading

import pytest

from symgrasp.engine import threads

PROGRAM = """
import numba, symgrasp as sg
sg.create_map(sg.load_scene("soda_can").with_settings(heights=4, angles=8, redundancy=4))
try:
    print(numba.threading_layer())
except ValueError:
    print("none")
"""


def test_a_map_starts_no_threads_of_numba():
    """Whatever is imported first, and however its variables are set: there is nothing to set."""
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert done.stdout == "none\n"


@pytest.fixture(autouse=True)
def four_cores(monkeypatch):
    monkeypatch.setattr(threads, "CORES", 4)
    monkeypatch.setattr(threads, "_used", 4)


def test_every_part_is_done_once():
    done = []
    threads.in_parallel(done.append, range(100))
    assert sorted(done) == list(range(100))


def test_as_many_run_at_once_as_there_are_cores():
    together = threading.Barrier(4, timeout=60)

    def wait(part: int) -> None:
        together.wait()

    threads.in_parallel(wait, range(8))
    threads.use_cores(2)
    assert threads.core_count() == 2
    names = set()
    threads.in_parallel(lambda part: names.add(threading.current_thread().name), range(50))
    assert len(names) <= 2


def test_no_fewer_than_one_core_and_no_more_than_there_are():
    for count, used in ((0, 1), (3, 3), (9, 4)):
        threads.use_cores(count)
        assert threads.core_count() == used


def test_what_a_part_raises_arrives():
    with pytest.raises(ZeroDivisionError):
        threads.in_parallel(lambda part: print(1 // (part - 3)), range(8))
