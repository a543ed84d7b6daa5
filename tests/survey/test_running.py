"""However a survey is run, and whatever is killed meanwhile, its store is the same to the bit."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from queue import SimpleQueue
from typing import Any

import numpy as np
import psutil
import pytest
from distributed import LocalCluster

from app.server.door.viser_server import any_port
from symgrasp.cli.main import main
from symgrasp.errors import SurveyError
from symgrasp.feasibility.create import create_map
from symgrasp.reason import Reason
from symgrasp.scene.scene import Scene
from symgrasp.survey import running
from symgrasp.survey.evaluation import Evaluator, State
from symgrasp.survey.results import feasible_cells, workspace
from symgrasp.survey.running import Done, run_batch, run_survey
from symgrasp.survey.store import SurveyStore, create_store, open_results
from symgrasp.survey.survey import Survey

TEXT = """
schema_version: 1
name: tiny
scene: soda_can
map: {heights: 3, angles: 12, redundancy: 4}
maps: true
axes:
  - {name: table, of: obstacles.table.pose.position.2, values: [-0.05, -0.02]}
  - {name: x, of: position.x, from: 0.45, to: 0.6, count: 4}
  - {name: y, of: position.y, values: [-0.1, 0.2]}
  - {name: tilt, of: tilt_deg, values: [0, 60]}
"""

THREADS: Any = {"processes": False, "protocol": "tcp", "host": "127.0.0.1", "dashboard_address": ":0"}
"""Of a cluster whose workers are threads of this process, at an address as those of processes have."""

KILLED = """
import os, signal, sys
from symgrasp.survey.running import run_survey
from symgrasp.survey.survey import Survey

def die(done):
    if done.points:
        os.kill(os.getpid(), signal.SIGKILL)

if __name__ == "__main__":
    run_survey(Survey.load(sys.argv[1]), sys.argv[2], workers=1, progress=die)
"""


KILLED_WRITING = """
import os, signal, sys
from symgrasp.survey.evaluation import Evaluator
from symgrasp.survey.store import SurveyStore, create_store
from symgrasp.survey.survey import Survey

def written(store, state):
    names = before(store, state)
    yield from names[: int(sys.argv[3])]
    os.kill(os.getpid(), signal.SIGKILL)

survey = Survey.load(sys.argv[1])
with Evaluator(survey) as evaluator:
    batches = [{p: evaluator.point(p) for p in survey.points_of(b)} for b in (0, 1)]
store, before = SurveyStore(sys.argv[2], survey), SurveyStore._written
store.write(0, batches[0])
SurveyStore._written = written
store.write(1, batches[1])
"""

VARIABLES = ["share", "best", "margin", "cells", "feasible", "state"]
"""Of which a batch of the survey has a chunk, as they are written."""


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("survey") / "tiny.yaml"
    path.write_text(TEXT)
    return path


@pytest.fixture(scope="module")
def survey(file) -> Survey:
    return Survey.load(file)


@pytest.fixture(scope="module")
def one_go(survey, tmp_path_factory) -> Path:
    """A store that is written batch by batch, without a cluster."""
    path = tmp_path_factory.mktemp("one_go") / "a.zarr"
    store = create_store(path, survey)
    with Evaluator(survey) as evaluator:
        for batch in range(survey.batches):
            store.write(batch, {p: evaluator.point(p) for p in survey.points_of(batch)})
    return path


def threads(count: int) -> Any:
    """Return a cluster whose worker is this process."""
    return LocalCluster(n_workers=1, threads_per_worker=count, **THREADS)


def content(path: Path) -> dict[str, bytes]:
    return {str(p.relative_to(path)): p.read_bytes() for p in sorted(path.rglob("*")) if p.is_file()}


def test_points_are_what_plain_loops_give(survey, one_go):
    """Every scene is written out anew, and its map computed alone."""
    _, results = open_results(one_go)
    cells = feasible_cells(survey, results)
    base = Scene.load("soda_can").content
    states = []
    for k, point in enumerate(np.ndindex(survey.shape)):
        table, x, y, tilt = (axis.values[i] for axis, i in zip(survey.axes, point, strict=True))
        found = results.isel(dict(zip(("table", "x", "y", "tilt"), point, strict=True)))
        states.append(int(found.state))
        if found.state != State.COMPUTED or k % 3:
            continue
        pose = {"position": [x, y, base["tasks"][0]["pose"]["position"][2]], "rpy_deg": [0, tilt, 0]}
        obstacles = [dict(o) for o in base["obstacles"]]
        (own,) = [o for o in obstacles if o["name"] == "table"]
        own["pose"] = {**own["pose"], "position": [*own["pose"]["position"][:2], table]}
        tasks = [{**base["tasks"][0], "pose": pose}]
        settings = {"heights": 3, "angles": 12, "redundancy": 4}
        m = create_map(Scene.from_content({**base, "obstacles": obstacles, "tasks": tasks, "map": settings}))
        assert float(found.share) == m.feasible.mean()
        assert dict(zip(found.reason.values, found["cells"].values.tolist(), strict=True)) == {
            reason.name: m.counts().get(reason, 0) for reason in Reason
        }
        where = dict(zip(("table", "x", "y", "tilt"), point, strict=True))
        assert np.array_equal(cells.isel(where).values, m.feasible)
        if m.feasible.any():
            assert m.feasible[tuple(found.best.values)]
    assert {State.COMPUTED, State.OBJECT_BLOCKED} == set(states)
    assert (results.share > 0).any()


def test_workers_that_die_change_nothing(survey, one_go, tmp_path):
    killed = []

    def kill(done: Done) -> None:
        if done.points and not killed:
            workers = [
                p for p in psutil.Process().children(recursive=True) if "spawn_main" in str(p.cmdline())
            ]
            killed.append(workers[0])
            workers[0].kill()

    run_survey(survey, tmp_path / "b.zarr", workers=2, progress=kill)
    assert killed
    assert content(tmp_path / "b.zarr") == content(one_go)


def test_a_killed_run_goes_on(survey, file, one_go, tmp_path):
    out = tmp_path / "b.zarr"
    script = tmp_path / "killed.py"
    script.write_text(KILLED)
    program = [sys.executable, str(script), str(file), str(out)]
    assert subprocess.run(program, check=False).returncode == -signal.SIGKILL
    assert 0 < len(SurveyStore(out, survey).missing()) < survey.batches
    half_written = out / "state/c/0.6b95ef98105947269c16cb8a41064e41.partial"  # as of a killed worker
    half_written.touch()
    counts: list[Done] = []
    with threads(8) as cluster:
        run_survey(survey, out, scheduler=cluster.scheduler_address, progress=counts.append)
    assert counts[0].points > 0
    assert counts[-1] == (survey.points, survey.points)
    assert content(out) == content(one_go)
    half_written.touch()
    run_survey(survey, out)
    assert content(out) == content(one_go)


@pytest.mark.parametrize("count", range(len(VARIABLES)))
def test_a_region_that_is_written_in_part_is_computed_anew(survey, file, one_go, tmp_path, count):
    """A process is killed after some chunks of a batch were written; beside them lies half of one."""
    out, script = tmp_path / "b.zarr", tmp_path / "killed.py"
    create_store(out, survey)
    script.write_text(KILLED_WRITING)
    program = [sys.executable, str(script), str(file), str(out), str(count)]
    assert subprocess.run(program, check=False).returncode == -signal.SIGKILL
    (where,) = [p.parent.relative_to(one_go / "share/c") for p in chunks(one_go / "share/c")[1:2]]
    there = {name: len(chunks(out / name / "c")) for name in VARIABLES}
    assert there == {name: 1 + (k < count) for k, name in enumerate(VARIABLES)}
    half = out / VARIABLES[count] / "c" / where / "a.partial"
    half.parent.mkdir(parents=True, exist_ok=True)
    half.write_bytes(b"half")
    store = SurveyStore(out, survey)
    assert store.missing() == list(range(1, survey.batches))
    with Evaluator(survey) as evaluator:
        for batch in store.missing():
            store.write(batch, {p: evaluator.point(p) for p in survey.points_of(batch)})
    store.remove_partial()
    assert content(out) == content(one_go)


def chunks(folder: Path) -> list[Path]:
    """Return the chunks of a variable."""
    return sorted(p for p in folder.rglob("*") if p.is_file())


@pytest.fixture
def started(tmp_path) -> Iterator[Callable[[str, str], subprocess.Popen[bytes]]]:
    """Start parts of a cluster, each a process of its own; they are killed in the end."""
    running: list[subprocess.Popen[bytes]] = []

    def start(*command: str) -> subprocess.Popen[bytes]:
        program = [sys.executable, "-m", *command, "--no-dashboard"]
        running.append(subprocess.Popen(program, stderr=subprocess.DEVNULL, cwd=tmp_path))
        return running[-1]

    yield start
    for process in running:
        process.kill()
        process.wait()


def test_a_killed_scheduler_leaves_a_good_store(survey, file, one_go, tmp_path, started, caplog):
    """The scheduler is killed in the middle of a run on a cluster of separate processes."""
    out, address = tmp_path / "b.zarr", f"tcp://127.0.0.1:{any_port()}"
    scheduler = started("distributed.cli.dask_scheduler", "--host", address)
    for _ in range(2):
        started("distributed.cli.dask_worker", address, "--nthreads", "1", "--no-nanny")
    counts: list[Done] = []

    def kill(done: Done) -> None:
        counts.append(done)
        if done.points:
            scheduler.kill()

    with pytest.raises(SurveyError, match="run it again"):
        run_survey(survey, out, scheduler=address, progress=kill)
    assert not caplog.records
    missing = len(SurveyStore(out, survey).missing())
    assert 0 < missing < survey.batches
    assert main(["survey", "run", str(file), "--out", str(out), "--workers", "1"]) == 0
    assert content(out) == content(one_go)


@pytest.mark.parametrize("workers", [1, 2, 4])
def test_any_number_of_workers_writes_the_same(survey, one_go, tmp_path, workers):
    cluster: Any = LocalCluster(n_workers=workers, threads_per_worker=1, **THREADS)
    with cluster:
        run_survey(survey, tmp_path / "b.zarr", scheduler=cluster.scheduler_address)
    assert content(tmp_path / "b.zarr") == content(one_go)


def test_a_cluster_without_workers_is_told(survey, tmp_path, monkeypatch):
    monkeypatch.setattr(running, "LOOK", 0.01)
    monkeypatch.setattr(running, "IDLE", 0.03)
    none: Any = LocalCluster(n_workers=0, **THREADS)
    with none as cluster, pytest.raises(SurveyError) as raised:
        run_survey(survey, tmp_path / "b.zarr", scheduler=cluster.scheduler_address)
    assert "scheduler: workers: 'idle': expected a worker that computes" in str(raised.value)
    assert len(SurveyStore(tmp_path / "b.zarr", survey).missing()) == survey.batches


class Workers:
    """Workers of a cluster that compute, or do not, each time that they are looked at.

    Args:
        looks: whether they compute, look by look; the batch ends after the last.
        results: where its future is put then.
    """

    def __init__(self, looks: list[bool], results: SimpleQueue[str]) -> None:
        self.looks, self.results = looks, results

    def processing(self) -> dict[str, list[str]]:
        """Return what each worker computes."""
        computes = self.looks.pop(0)
        if not self.looks:
            self.results.put("the batch")
        return {"one": [], "other": ["run_batch"] if computes else []}


@pytest.mark.parametrize("looks", [[True] * 30, [False, False, True] * 10])
def test_a_batch_that_takes_long_is_waited_for(looks, monkeypatch):
    """Workers have nothing for a moment while one that died is started again."""
    monkeypatch.setattr(running, "LOOK", 0.001)
    monkeypatch.setattr(running, "IDLE", 0.003)
    results: SimpleQueue[str] = SimpleQueue()
    assert running._next(results, Workers(list(looks), results)) == "the batch"
    with pytest.raises(SurveyError, match="none has for"):
        running._next(results, Workers([False] * 30, results))


def test_the_workspace_of_a_grasp_is_what_the_maps_of_its_places_say(survey, one_go, tmp_path, capsys):
    """Where may the object stand, for a grasp at a height and roll? Against maps that are computed alone."""
    _, results = open_results(one_go)
    h, roll = 0.06, 180
    found = workspace(survey, results, h, roll).sel(table=-0.05, tilt=0)
    scene = Scene.load("soda_can").with_settings(heights=3, angles=12, redundancy=4)
    scene = with_number_of_table(scene, -0.05)
    row, _ = scene.manifold.cell(h, 0.0)
    for x in found.x.values:
        for y in found.y.values:
            share = float(found.sel(x=x, y=y))
            if math.isnan(share):
                continue
            T = np.array(scene.task().T_world_object)
            T[:2, 3] = x, y
            m = create_map(scene.with_task(replace(scene.task(), T_world_object=T)))
            assert share == pytest.approx(100 * m.feasible[1, row].mean())
    assert 0 < float((found > 0).mean()) < 1
    picture = tmp_path / "workspace.png"
    shown = ["survey", "show", str(one_go), "--grasp", "6", "--roll", "180", "--out", str(picture)]
    assert main(shown) == 0
    assert picture.read_bytes().startswith(b"\x89PNG")


def with_number_of_table(scene: Scene, z: float) -> Scene:
    """Return the scene with its table at another height."""
    obstacles = [dict(o) for o in scene.content["obstacles"]]
    (table,) = [o for o in obstacles if o["name"] == "table"]
    table["pose"] = {**table["pose"], "position": [*table["pose"]["position"][:2], z]}
    return Scene.from_content({**scene.content, "obstacles": obstacles})


def test_damage_is_found(survey, one_go, tmp_path):
    """A chunk that is cut, changed or gone is computed anew."""
    path = tmp_path / "b.zarr"
    for name, data in content(one_go).items():
        (path / name).parent.mkdir(parents=True, exist_ok=True)
        (path / name).write_bytes(data)
    store = SurveyStore(path, survey)
    assert store.missing() == []
    first, second, third, *_ = (c for c in sorted((path / "margin/c").rglob("*")) if c.is_file())
    first.unlink()
    second.write_bytes(second.read_bytes()[:-1])
    data = bytearray(third.read_bytes())
    data[0] ^= 1
    third.write_bytes(data)
    assert len(store.missing()) == 3


def test_another_survey_does_not_mix(file, one_go, tmp_path, capsys):
    other = tmp_path / "other.yaml"
    other.write_text(file.read_text().replace("0.45", "0.4"))
    assert main(["survey", "run", str(other), "--out", str(one_go)]) == 2
    assert "another folder" in capsys.readouterr().err


def test_interrupted(survey, tmp_path):
    def interrupt(done: Done) -> None:
        os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        run_survey(survey, tmp_path / "b.zarr", workers=1, progress=interrupt)
    assert len(SurveyStore(tmp_path / "b.zarr", survey).missing()) == survey.batches


def test_a_worker_with_other_files_writes_nothing(survey, tmp_path):
    """A machine whose robot is described by other files than the store's is told so."""
    path = tmp_path / "b.zarr"
    create_store(path, survey)
    description = path / "zarr.json"
    description.write_text(description.read_text().replace(survey.sha256, "0" * 64))
    before = content(path)
    with pytest.raises(SurveyError, match="robots and program"):
        run_batch(json.dumps(survey.to_dict()), str(path), 0)
    assert content(path) == before
