"""Free motions are compared with other planners; no figure here depends on how fast the machine is."""

from __future__ import annotations

from symgrasp.bench.figures import keyed
from symgrasp.bench.motions import motion_times


def test_free_motions_are_compared_with_other_planners_and_looked_at():
    kind = "between random boxes"
    found = keyed([*motion_times.free_motions(kind, count=2), *motion_times.proofs(kind, count=3)])
    own, rivals = f"free motion {kind}", ("RRT-Connect of OMPL with PyBullet", "roboplan")
    for rival in rivals:
        whole = found[f"{own}: {rival}, times as long"].values
        alone = found[f"{own}: {rival}, times as long without its shortening"].values
        assert all(0 < a <= b for a, b in zip(alone, whole, strict=True))
        searched = found[f"{own}: {rival}, times as long before either path is shortened"].values
        assert len(searched) == len(whole)
        assert all(value > 0 for value in searched)
        assert found[f"{own}: {rival}, found"].values == (1.0,)
    looked = f"3 free motions {kind}: found"
    assert found[looked].values == (1.0,)
    assert found[f"{looked}: found by OMPL in {motion_times.LONGER} times the time"].values[0] > 0
    assert found[f"{looked}: share that touches something, by PyBullet"].values == (0.0,)
