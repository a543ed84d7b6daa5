"""Running a survey on a Dask cluster: of this machine's cores, or any that is there already."""

from __future__ import annotations

import json
import logging
import re
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple

import numpy as np
from dask import config
from distributed import Client, LocalCluster
from distributed.comm.core import CommClosedError
from distributed.security import Security

from symgrasp.engine.threads import CORES, use_cores
from symgrasp.errors import SurveyError
from symgrasp.survey.evaluation import Evaluator
from symgrasp.survey.store import SurveyStore, create_store, open_results
from symgrasp.survey.survey import Survey

__all__ = ["Done", "cluster", "plan_margins_on", "run_on", "run_survey"]

AHEAD = 3
"""Batches for each thread of the cluster that are submitted before their turn, so that none waits."""

HOST = "127.0.0.1"
"""Where the processes of a local cluster listen: nobody else's machine can reach them."""

ADDRESS = re.compile(r"(?P<protocol>tcp|tls)://([\w.-]+|\[[\da-fA-F:.]+\]):(?P<port>\d{1,5})")

FAILURES = 3
"""A batch that so many workers died of is given up."""


LOOK = 10.0
"""Time (s) without a result after which the workers are looked at."""

IDLE = 60.0
"""Time (s) after which a survey is given up whose workers all have nothing to do, or are gone."""


class Done(NamedTuple):
    """How far a survey is: points that are computed, of all points."""

    points: int
    of: int


def run_survey(
    survey: Survey,
    out: str | Path,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: Callable[[Done], None] | None = None,
) -> None:
    """Compute all points of a survey that a store does not hold yet.

    Args:
        survey: the survey.
        out: the folder of the store; it is made if there is none.
        workers: see `cluster`.
        scheduler: see `cluster`.
        progress: called at the beginning and after every batch; may raise `Cancelled`. What is written
            stays.

    Raises:
        SurveyError: the store is another survey's, or the cluster cannot be reached or was lost.
    """
    store = create_store(Path(out), survey)
    if store.missing():
        with cluster(workers, scheduler) as client:
            run_on(client, survey, out, progress)
        return
    store.remove_partial()  # the last run may have been killed after its last batch
    if progress:
        progress(Done(survey.points, survey.points))


def run_on(
    client: Client, survey: Survey, out: str | Path, progress: Callable[[Done], None] | None = None
) -> None:
    """Do what `run_survey` does on a cluster that is there.

    Args:
        client: of the cluster.
        survey: the survey.
        out: the folder of the store; it is made if there is none.
        progress: called at the beginning and after every batch.

    Raises:
        SurveyError: the store is another survey's, or the cluster was lost, or none of its workers computes.
    """
    path = Path(out).resolve()
    store = create_store(path, survey)
    missing = store.missing()
    total, left = survey.points, sum(_size(survey, batch) for batch in missing)
    if progress:
        progress(Done(total - left, total))
    known: Any = client  # whose methods are coroutines too, for those who ask for that
    threads = max(1, sum(known.nthreads().values()))
    # Every batch brings the survey along: what was scattered before would be lost with its workers.
    text, results = json.dumps(survey.to_dict()), SimpleQueue()
    waiting = (client.submit(run_batch, text, str(path), batch, pure=False, retries=0) for batch in missing)
    running: set[Any] = set()  # a batch is given up when nobody holds its future
    for future in islice(waiting, AHEAD * threads):
        running.add(future)
        future.add_done_callback(results.put)
    while running:
        future = _next(results, known)
        running.remove(future)
        left -= _size(survey, _result(future))
        if progress:
            progress(Done(total - left, total))
        if following := next(waiting, None):
            running.add(following)
            following.add_done_callback(results.put)
    store.remove_partial()  # what killed workers, and earlier runs that were killed, have left


def plan_margins_on(
    client: Client, folder: Path, progress: Callable[[Done], None] | None, survey: Survey
) -> np.ndarray:
    """Run a survey that asks for plans on a cluster that is there; see `symgrasp.survey.placement.Surveyed`.

    Args:
        client: of the cluster.
        folder: of the stores of such surveys, by their names; what is there from an earlier call is used.
        progress: see `run_on`.
        survey: the survey.

    Raises:
        SurveyError: a store is another survey's, or the cluster was lost.
    """
    out = folder / f"{survey.file.name}.zarr"
    run_on(client, survey, out, progress)
    _, results = open_results(out)
    return results["plan_margin"].where(results["plan"]).values


def _next(results: SimpleQueue[Any], client: Any) -> Any:
    """Return the next batch that has ended.

    Raises:
        SurveyError: none ends, and no worker computes any: all are gone, or the scheduler gives them nothing.
    """
    idle = 0
    while True:
        try:
            return results.get(timeout=LOOK)
        except Empty:
            idle = 0 if _computes(client) else idle + 1
        if idle * LOOK >= IDLE:
            expected = f"a worker that computes (none has for {IDLE:.0f} s); run it again"
            raise SurveyError("scheduler", "workers", "idle", expected)


def _computes(client: Any) -> bool:
    """Return whether any worker of the cluster has something to compute."""
    try:
        return any(client.processing().values())
    except (OSError, RuntimeError):  # the scheduler was lost: its futures come as such, or never
        return False


def _result(future: Any) -> int:
    """Return the batch that was computed."""
    try:
        if future.status not in ("cancelled", "lost"):
            return future.result()
    except (CommClosedError, CancelledError):
        pass  # the scheduler was lost while it was asked for the result
    raise SurveyError("scheduler", "state", "lost", "a cluster that goes on running; run it again")


def _size(survey: Survey, batch: int) -> int:
    size = 1
    for part in survey.region(batch):
        size *= part.stop - part.start
    return size


@contextmanager
def cluster(workers: int | None = None, scheduler: str | None = None) -> Iterator[Client]:
    """Connect to a cluster; a local one listens to nobody but its own processes, and ends with the block.

    Args:
        workers: processes on this machine; as many as it has cores if None.
        scheduler: address of the scheduler of a running Dask cluster, such as ``tcp://10.0.0.1:8786``, to use
            instead. It is trusted: it can run anything here. Its workers see the store and the files of the
            scene under the same paths.

    Yields:
        The client of the cluster.

    Raises:
        SurveyError: there is no scheduler at that address.
    """
    settings = {
        "distributed.scheduler.allowed-failures": FAILURES,
        "distributed.scheduler.work-stealing": False,
        "distributed.worker.profile.enabled": False,
        "distributed.admin.tick.interval": "1s",  # by default 50 times a second, in every process
        "distributed.admin.tick.limit": "60s",
        "distributed.admin.system-monitor.interval": "10s",
        "distributed.scheduler.http.routes": [],
        "distributed.worker.http.routes": [],
    }
    with config.set(settings), _quiet():
        if scheduler is not None:
            _check_address(scheduler)
            try:
                client = Client(scheduler, timeout=10, set_as_default=False)
            except (OSError, ValueError) as error:
                text = f"the address of a running Dask scheduler ({type(error).__name__})"
                raise SurveyError("command line", "--scheduler", scheduler, text) from error
            with client:
                yield client
            return
        with (
            LocalCluster(
                n_workers=workers or CORES,
                threads_per_worker=1,
                host=HOST,
                dashboard_address=f"{HOST}:0",
                worker_dashboard_address=f"{HOST}:0",
                silence_logs=logging.CRITICAL,
                memory_limit=0,
                security=Security.temporary(),
            ) as local,
            Client(local, set_as_default=False) as client,
        ):
            yield client


def _check_address(scheduler: str) -> None:
    """Check that something can be an address, before a client is made: one that fails waits when it ends.

    Raises:
        SurveyError: it cannot.
    """
    found = ADDRESS.fullmatch(scheduler)
    if not found or not 0 < int(found["port"]) < 2**16:
        text = "the address of a running Dask scheduler, such as tcp://10.0.0.1:8786"
        raise SurveyError("command line", "--scheduler", scheduler, text)
    if found["protocol"] == "tls" and Security().get_connection_args("client").get("ssl_context") is None:
        text = "an address tcp://…, or the certificates of Dask in its configuration, distributed.comm.tls"
        raise SurveyError("command line", "--scheduler", scheduler, text)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep what Dask logs of connections that were lost out of what people read: an error says it."""
    names = [name for name in logging.root.manager.loggerDict if name.split(".")[0] == "distributed"]
    levels = {name: logging.getLogger(name).level for name in names}  # some have levels of their own
    try:
        for name in names:
            logging.getLogger(name).setLevel(logging.CRITICAL)
        yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


_own = threading.local()


def run_batch(text: str, folder: str, batch: int) -> int:
    """Compute a batch and write it, on a worker; return its number.

    Worlds and engines stay between the batches of a thread. Maps are computed on one core: the others belong
    to other workers. A worker whose files or program are others than those of the store writes nothing.

    Args:
        text: the survey as plain data in JSON.
        folder: of the store.
        batch: the number of the batch.
    """
    if getattr(_own, "of", None) != (text, folder):
        use_cores(1)
        if hasattr(_own, "evaluator"):
            _own.evaluator.close()
        survey = Survey.from_dict(json.loads(text))
        _own.evaluator, _own.store = Evaluator(survey), SurveyStore(folder, survey)
        _own.of = text, folder
    evaluator: Evaluator = _own.evaluator
    _own.store.write(batch, {point: evaluator.point(point) for point in evaluator.survey.points_of(batch)})
    return batch
