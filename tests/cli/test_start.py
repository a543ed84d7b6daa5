"""What is asked without computing anything is answered without loading what computes."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = {
    "dask", "distributed", "matplotlib", "numba", "numpy", "pybullet", "pydantic", "rich", "scipy", "trimesh",
    "viser", "xarray", "yaml", "zarr",
}  # fmt: skip

PROGRAM = """
import atexit, sys
atexit.register(lambda: print("loaded:", *sorted(sys.modules), file=sys.stderr))
from symgrasp.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


def loaded(*arguments: str, status: int) -> set[str]:
    """Run a command in a process of its own; return the heavy packages that it loaded."""
    command = [sys.executable, "-c", PROGRAM, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stderr
    return HEAVY & set(done.stderr.splitlines()[-1].removeprefix("loaded: ").split())


@pytest.mark.parametrize(
    ("arguments", "status"),
    [
        (["--help"], 0),
        (["plan", "--help"], 0),
        (["schema", "scene"], 0),
        (["schema", "plan"], 0),
        (["survey", "run"], 2),
        ([], 2),
        (["paln"], 2),
        (["plan", "sequential", "soda_can", "--list", "none"], 2),
        (["plan", "sequential", "soda_can"], 2),
        (["plan", "bimanual", "soda_can", "--list", "1", "--method", "climb"], 2),
        (["map", "soda_can", "--out", "map.gif"], 2),
        (["object", "wine_glass", "--out", "glass.gif"], 2),
        (["export", "csv", "plan.json", "--out", "no/such/folder/plan.csv"], 2),
    ],
)
def test_options_need_no_heavy_package(arguments, status):
    assert loaded(*arguments, status=status) == set()


@pytest.mark.parametrize("arguments", [["scenes"], ["survey", "list"]])
def test_lists_of_what_ships_need_yaml_only(arguments):
    assert loaded(*arguments, status=0) == {"yaml"}


def test_a_map_needs_nothing_of_surveys():
    assert not loaded("map", "soda_can", "--redundancy", "1", status=0) & {
        "dask",
        "distributed",
        "xarray",
        "zarr",
    }
