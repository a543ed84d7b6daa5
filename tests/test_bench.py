"""The benchmark measures what it says; no figure here depends on how fast the machine is."""

from __future__ import annotations

import json

from symgrasp import bench
from symgrasp.bench import planners
from symgrasp.cli import main


def figures(found) -> dict[str, bench.Figure]:
    return {figure.name.strip(): figure for figure in found}


def test_two_hands_exact_never_misses_what_climbing_finds():
    found = figures(planners.several_hands(pairs=3))
    (exact,) = found["two hands, complete search: success in 6 pairs"].values
    (climb,) = found["two hands, hill climbing as printed: success in 6 pairs"].values
    assert exact >= climb > 0
    assert len(found["two hands, complete search with whole robots"].values) == 6
    assert min(found["smallest of gap and margins, more than climbing reaches"].values) >= -1e-9


def test_on_the_command_line(monkeypatch, tmp_path, capsys):
    made = [bench.Figure("a", "ms", (1.0, 2.0, 4.0)), bench.Figure("b", "×", (3.0,))]
    monkeypatch.setattr(bench, "run", lambda: iter(made))
    assert main(["bench", "--out", str(tmp_path / "bench.json")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "2 ms" in lines[0]
    assert "(1 to 4)" in lines[0]
    content = json.loads((tmp_path / "bench.json").read_text())
    assert content["figures"][1] == {"name": "b", "unit": "×", "values": [3.0]}
    assert content["machine"]["cpus"] >= 1


def test_a_long_sequence_and_sampling_are_measured():
    (sequence,) = planners.long_sequence(tasks=6, runs=2)
    assert len(sequence.values) == 2
    success, *ratios = planners.without_the_manifold(runs=2)
    assert set(success.values) <= {0.0, 1.0}
    assert [len(ratio.values) for ratio in ratios] == [2, 2]
