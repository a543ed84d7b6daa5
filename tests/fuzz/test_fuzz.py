"""Whatever a file holds, a command ends in exit status 0, 1 or 2, with plain words and nothing left behind.

The numbers of cases and the seed are fixed, so that two runs try the same. By hand, for longer:
``pytest tests/fuzz --fuzz-cases 5000 --fuzz-seed 7``. A failure names the folder with its files and the
number of the case, which ``--fuzz-first K --fuzz-cases 1`` runs again.
"""

from __future__ import annotations

import json
import random
import subprocess
import sys
import unicodedata
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.fuzz.inputs import KINDS, Case, plans
from tests.fuzz.runner import Run

pytestmark = pytest.mark.fuzz

MEMORY_LIMIT = 4_000_000_000
"""Largest resident memory (bytes) of a command."""

LINE_LIMIT = 300
"""Longest line (characters) on stderr."""


class Runner:
    """A process that runs commands; see `tests.fuzz.runner`."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.fuzz.runner"],
            cwd=ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(self, case: Case, folder: Path) -> Run:
        folder.mkdir()
        for name, content in case.files.items():
            (folder / name).write_bytes(content)
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.write(json.dumps({"argv": case.argv, "folder": str(folder)}) + "\n")
        self._process.stdin.flush()
        return Run(*json.loads(self._process.stdout.readline()))

    def close(self) -> None:
        self._process.communicate()


@pytest.fixture(scope="module")
def runner() -> Iterator[Runner]:
    runner = Runner()
    yield runner
    runner.close()


@pytest.fixture(scope="module")
def plan(runner: Runner, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A plan that holds."""
    folder = tmp_path_factory.mktemp("plan") / "plan"
    run = runner.run(Case(["plan", "sequential", "pick_pour_place", "--out", "plan.json"], {}), folder)
    assert run.status == 0, (folder / "stderr").read_text()
    return (folder / "plan.json").read_bytes()


@pytest.mark.parametrize("kind", KINDS)
def test_any_input_ends_in_plain_words(
    kind: str, runner: Runner, plan: bytes, tmp_path: Path, pytestconfig: pytest.Config, thorough: bool
) -> None:
    first, seed = (whole_option(pytestconfig, f"fuzz_{name}") for name in ("first", "seed"))
    asked = pytestconfig.getoption("fuzz_cases")
    count = (50 if thorough else 15) if asked is None else int(asked)
    faults, statuses = [], {0: 0, 1: 0, 2: 0}
    cpu, peak = 0.0, 0
    for k in range(first, first + count):
        rng = random.Random(f"{seed}/{kind}/{k}")
        case = plans(rng, plan) if kind == "plans" else KINDS[kind](rng)
        folder = tmp_path / str(k)
        run = runner.run(case, folder)
        faults += [
            f"case {k}, {' '.join(case.argv)!r} in {folder}: {fault}"
            for fault in found_faults(run, case, folder)
        ]
        statuses[run.status] = statuses.get(run.status, 0) + 1
        cpu, peak = max(cpu, run.cpu), max(peak, run.peak)
    print(f"{kind}: exit statuses {statuses}, at most {cpu:.1f} s of CPU, {peak / 1e6:.0f} MB")
    assert not faults, "\n".join(faults)
    if count > 50:
        assert statuses[0] and statuses[2], f"{statuses}: damage that is always or never noticed tests little"


def whole_option(config: pytest.Config, name: str) -> int:
    value = config.getoption(name)
    assert isinstance(value, int)
    return value


def found_faults(run: Run, case: Case, folder: Path) -> list[str]:
    """Return what is wrong with a run, a line each."""
    out, err = (folder / name for name in ("stdout", "stderr"))
    said = err.read_bytes().decode(errors="replace")
    faults = []
    if run.status not in (0, 1, 2):
        faults.append(f"exit status {run.status} after {run.cpu:.1f} s of CPU: {said[-300:]}")
    if "Traceback" in said or "Warning" in said:
        faults.append(f"a traceback or warning: …{said[-300:]}")
    if run.status and not said.strip() and not out.read_bytes().strip():
        faults.append("no word about why")
    for name, text in (("stdout", out.read_bytes().decode(errors="replace")), ("stderr", said)):
        # "\r" begins a line of progress.
        controls = {c for c in text if unicodedata.category(c) in ("Cc", "Cf", "Cs") and c not in "\n\r"}
        if controls:
            faults.append(f"control characters on {name}: {controls}")
    longest = max(map(len, said.splitlines()), default=0)
    if longest > LINE_LIMIT:
        faults.append(f"a line of {longest} characters: {said[:200]}")
    if run.left:
        faults.append(f"temporary files: {run.left}")
    if case.out and run.status == 2 and (folder / case.out).exists():
        faults.append(f"{case.out} was written all the same")
    if run.peak > MEMORY_LIMIT:
        faults.append(f"{run.peak / 1e9:.1f} GB")
    return faults
