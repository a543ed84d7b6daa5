"""What became slower than in a kept run."""

from __future__ import annotations

import json

import pytest

from symgrasp import bench
from symgrasp.bench import Figure, report, slower
from symgrasp.cli.main import main

KEPT = [
    Figure("map", "ms", (10.0, 11.0, 12.0), (20.0, 21.0, 22.0)),
    Figure("  built", "ms", (5.0, 5.0)),
    Figure("against", "×", (3.0,)),
    Figure("memory", "MB", (100.0,)),
    Figure("not measured", "", ()),
]


def test_a_run_is_not_slower_than_itself():
    assert slower(report(KEPT), KEPT) == []


def test_what_is_slower_is_named_by_what_it_belongs_to():
    built = KEPT[1].__class__("  built", "ms", (5.6, 5.8))
    assert slower(report(KEPT), [KEPT[0], built, *KEPT[2:]]) == ["map: built: 5.7 ms, was 5 ms"]


def test_cpu_time_counts_and_not_that_the_machine_is_busy():
    busy = Figure("map", "ms", (50.0, 70.0), (21.0, 23.0))
    assert slower(report(KEPT), [busy, *KEPT[1:]]) == []
    more = Figure("map", "ms", (10.0, 11.0), (29.0, 30.0))
    assert slower(report(KEPT), [more, *KEPT[1:]]) == ["map: 29.5 ms CPU, was 21 ms CPU"]


def test_one_slow_run_is_no_change():
    assert slower(report(KEPT), [Figure("map", "ms", (1, 1, 9), (20.0, 21.0, 22.0, 90.0)), *KEPT[1:]]) == []


def test_ratios_are_not_compared_and_what_is_missing_is_said():
    assert slower(report(KEPT), [*KEPT[:2], Figure("against", "×", (9.0,))]) == [
        "memory: not measured any more"
    ]


@pytest.fixture
def kept(tmp_path, monkeypatch):
    monkeypatch.setattr(bench, "run", lambda: iter(KEPT))
    path = tmp_path / "kept.json"
    assert main(["bench", "--out", str(path)]) == 0
    return path


def test_the_command_says_what_became_slower(kept, monkeypatch, capsys):
    assert main(["bench", "--compare", str(kept)]) == 0
    monkeypatch.setattr(bench, "run", lambda: iter([Figure("map", "ms", (99.0,), (99.0,)), *KEPT[1:]]))
    capsys.readouterr()
    assert main(["bench", "--compare", str(kept)]) == 1
    assert f"slower than in {kept}: map: 99 ms CPU, was 21 ms CPU" in capsys.readouterr().out


@pytest.mark.parametrize("change", ["missing", "text", "keys", "number", "machine"])
def test_other_files_are_refused_before_anything_is_measured(kept, monkeypatch, capsys, change):
    monkeypatch.setattr(bench, "run", lambda: pytest.fail("measured"))
    content = json.loads(kept.read_text())
    if change == "missing":
        kept.unlink()
    elif change == "text":
        kept.write_text("{")
    else:
        if change == "keys":
            del content["figures"][0]["values"]
        elif change == "number":
            content["figures"][0]["values"] = "many"
        else:
            content["machine"]["cpus"] = 4096
        kept.write_text(json.dumps(content))
    capsys.readouterr()
    assert main(["bench", "--compare", str(kept)]) == 2
    error = capsys.readouterr().err
    assert str(kept) in error
    assert error.count("\n") == 1


def test_robots_are_not_compared(kept, capsys):
    assert main(["bench", "robots", "--compare", str(kept)]) == 2
    assert "--compare" in capsys.readouterr().err
