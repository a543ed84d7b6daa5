"""Maps with named dimensions say the same as maps."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr

from symgrasp.feasibility.create import create_map
from symgrasp.object.manifold import ROLLS
from symgrasp.reason import Reason
from tests.conftest import load_small


def test_named_dimensions_lead_to_the_same_values():
    m = create_map(load_small("bottle_on_table", 6, 12, 4))
    found = m.to_xarray()
    roll, row, column = np.argwhere(m.feasible)[0].tolist()
    h, theta = m.manifold.h[row], m.manifold.theta[column]
    cell = found.sel(h=h, theta=theta, roll=ROLLS[roll], method="nearest")
    assert cell.feasible
    assert int(cell.reason) == Reason.FEASIBLE
    assert np.array_equal(cell.q, m.q[roll, row, column])
    assert float(cell.clearance) == m.clearance[roll, row, column]
    assert (float(cell.margin_along), float(cell.margin_around)) == tuple(m.margin((roll, row, column)))
    assert dict(found.sizes) == {"roll": 2, "h": 6, "theta": 12, "joint": m.q.shape[-1]}
    names = found.reason.attrs["flag_meanings"].split()
    assert names[Reason.UNREACHABLE] == "UNREACHABLE"


def test_it_can_be_written_and_read(tmp_path):
    """As Zarr, and turned maps, whose angles begin elsewhere."""
    m = create_map(load_small("bottle_on_table", 4, 8, 2)).shift(math.radians(10))
    m.to_xarray().to_zarr(tmp_path / "map.zarr", consolidated=False, zarr_format=3)
    with xr.open_zarr(tmp_path / "map.zarr", consolidated=False, chunks=None) as read:
        assert np.array_equal(read.reason.values, m.reason)
        assert np.array_equal(read.theta.values, m.manifold.theta)
