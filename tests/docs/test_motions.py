"""What docs/motions.md says is what the benchmark measured."""

from __future__ import annotations

import json

import numpy as np

from docs.motions import BEGIN, END, MEASURED, PAGE, table
from symgrasp.bench.figures import Figure, keyed
from symgrasp.bench.motions import motion_times
from symgrasp.bench.motions.free_problems import PROBLEMS


def test_the_page_says_what_was_measured():
    """What fails here is mended by ``python -m docs.motions``."""
    content = json.loads(MEASURED.read_text(encoding="utf-8"))
    text = PAGE.read_text(encoding="utf-8")
    assert text.split(BEGIN)[1].split(END)[0].strip() == table(content).strip()


def measured() -> dict[str, Figure]:
    content = json.loads(MEASURED.read_text(encoding="utf-8"))
    return keyed(map(Figure.from_dict, content["figures"]))


def test_what_was_measured_is_what_the_benchmark_measures():
    """With as many runs, under the names that it has now."""
    found = measured()
    for name in motion_times.WHOLE:
        times = found[f"{name}: motion, once the maps exist"].values
        assert len(times) == 20
    for kind in PROBLEMS:
        assert len(found[f"free motion {kind}"].values) == 20
        assert (
            f"150 free motions {kind}: found: found by OMPL in {motion_times.LONGER} times the time" in found
        )
    assert len(found) == 2 * len(motion_times.WHOLE) + len(PROBLEMS) * (2 + 2 * 4 + 3)


def test_motions_are_found_fast_and_none_touches_anything():
    found = measured()
    for name in motion_times.WHOLE:
        own = f"{name}: motion, once the maps exist"
        assert max(found[own].values) <= 3.0
        assert found[f"{own}: found"].values == (1.0,)
    for kind in PROBLEMS:
        own, looked = f"free motion {kind}", f"150 free motions {kind}: found"
        for part in ("", " before either path is shortened", " without its shortening"):
            bullet = found[f"{own}: RRT-Connect of OMPL with PyBullet, times as long{part}"].values
            assert np.median(bullet) >= 20
            assert np.median(found[f"{own}: roboplan, times as long{part}"].values) > 1
        assert found[f"{looked}: share that touches something, by PyBullet"].values == (0.0,)
        theirs = found[f"{looked}: found by OMPL in {motion_times.LONGER} times the time"].values
        assert found[looked].values >= theirs
