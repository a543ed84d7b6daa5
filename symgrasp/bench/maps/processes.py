"""Times of whole processes: the command line, the first start on a machine, and two processes at once."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from tempfile import TemporaryDirectory
from typing import NamedTuple

from symgrasp.bench.figures import Figure
from symgrasp.bench.timing import Time, times

__all__ = ["commands", "first_start", "run", "two_at_once"]

MEASURE = """
import resource, subprocess, sys, time
start = time.perf_counter()
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
seconds, used = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
peak = used.ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)
print(seconds, used.ru_utime + used.ru_stime, peak)
"""
"""Program that runs a command and prints its time (s), its CPU time (s), and its peak memory (MB).

It runs as a small process of its own, because the peak of a child includes the memory of its parent that
it has between fork and exec.
"""

COMPUTE = """
import sys
from symgrasp.bench.maps.map_times import GRID
from symgrasp.bench.timing import time_of
from symgrasp.engine.threads import use_cores
from symgrasp.feasibility.create import MapMaker
from symgrasp.scene.scene import Scene
from symgrasp.world import open_world
use_cores(1)
with open_world(Scene.load("bottle_on_table").with_settings(**GRID)) as world:
    maker, count = MapMaker(world), int(sys.argv[1])
    maker.map()
    print("ready", flush=True)
    sys.stdin.readline()
    print(*time_of(lambda: [maker.map() for _ in range(count)]))
"""
"""Program that computes as many maps as it is told on one core, after a line on its standard input, and
prints how long that took (s), by the clock and in CPU time."""


class _Process(NamedTuple):
    """How long a process took, and the memory (MB) that it had at most."""

    time: Time
    memory: float


def run() -> Iterator[Figure]:
    """Run the benchmarks of processes and yield their figures as they are measured."""
    yield from commands(3)
    yield from first_start()
    yield from two_at_once(maps=20, rounds=3)


def commands(runs: int) -> Iterator[Figure]:
    """Time commands as processes, and the memory of one, with the compiled code cached."""
    yield times("symgrasp --help, whole process", "s", [_process(["--help"]).time for _ in range(runs)])
    command = ["map", "bottle_on_table"]
    _process(command)  # compiles what is not compiled yet
    found = [_process(command) for _ in range(runs)]
    yield times("symgrasp map bottle_on_table, whole process", "s", [p.time for p in found])
    yield Figure("  memory at most", "MB", tuple(p.memory for p in found))


def first_start() -> Iterator[Figure]:
    """Time commands that compile all they need, one after the other, as on a machine's first start."""
    with TemporaryDirectory() as folder:
        one = _process(["map", "bottle_on_table"], folder).time
        yield times("a first map, with all that it compiles", "s", [one])
        arm = _process(["plan", "sequential", "pick_pour_place", "--list", "1"], folder).time
        yield times("  a first plan of one arm after it", "s", [arm])
        arms = _process(["plan", "bimanual", "log_two_robots", "--list", "1"], folder).time
        yield times("  a first plan of two arms after it", "s", [arms])


def _process(command: Sequence[str], cache: str = "") -> _Process:
    """Run a command of symgrasp; with an empty folder as the cache of compiled code, all is compiled.

    Python keeps the bytecode of what it imports, as it does unless it is told not to.
    """
    program = [sys.executable, "-c", MEASURE, sys.executable, "-m", "symgrasp", *command]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    if cache:
        environment["NUMBA_CACHE_DIR"] = cache
    done = subprocess.run(program, check=True, stdout=subprocess.PIPE, text=True, env=environment)
    wall, cpu, peak = map(float, done.stdout.split())
    return _Process(Time(wall, cpu), peak)


def two_at_once(maps: int, rounds: int) -> Iterator[Figure]:
    """Compute maps in one process with one core, and as many in each of two processes at once.

    Two would do twice as much; less where they have to wait for each other, for memory say. CPU time tells
    this on a busy machine too, where two processes do not have a core each.
    """
    clock, cpu = [], []
    for _ in range(rounds):
        (alone,), both = _computed(maps, 1), _computed(maps, 2)
        clock.append(2 * alone.wall / max(time.wall for time in both))
        cpu.append(2 * alone.cpu / max(time.cpu for time in both))
    yield Figure("maps in two processes at once, over one", "×", tuple(clock))
    yield Figure("  in CPU time", "×", tuple(cpu))


def _computed(maps: int, processes: int) -> list[Time]:
    """Compute maps in some processes at once, and return how long each took."""
    program = [sys.executable, "-c", COMPUTE, str(maps)]
    running = [
        subprocess.Popen(program, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(processes)
    ]
    for process in running:
        assert process.stdout is not None
        process.stdout.readline()
    for process in running:
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
    outputs = [process.communicate()[0] for process in running]
    return [Time(*map(float, output.split())) for output in outputs]
