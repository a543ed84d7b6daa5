"""The trees of free motions."""

from __future__ import annotations

import numpy as np
import pytest

from symgrasp.motion.paths.trees import new_trees


@pytest.mark.parametrize("seed", [0, -1, 10**11, 2**64, 2**200])
def test_any_seed_starts_the_random_numbers(seed):
    roots = np.zeros((1, 2))
    assert new_trees(roots, roots, 1, seed).random[0] > 0
