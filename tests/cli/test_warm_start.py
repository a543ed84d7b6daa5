"""Once all is compiled and kept, a map takes no library that only compiling and reading meshes need."""

from __future__ import annotations

import subprocess
import sys

from symgrasp.cli.main import main

COLD = {
    "matplotlib", "networkx", "scipy.linalg", "scipy.optimize", "scipy.spatial", "shapely", "trimesh",
    "yourdfpy", "numba.np.arraymath", "numba.np.linalg",
}  # fmt: skip

PROGRAM = """
import sys
from symgrasp.cli.main import main
assert main(["map", "bottle_on_table"]) == 0
print(*sys.modules)
"""


def test_a_warm_map_imports_no_library_that_only_a_cold_one_needs(capsys):
    assert main(["map", "bottle_on_table"]) == 0  # compiles and keeps what is not yet there
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    *lines, modules = done.stdout.splitlines()
    assert lines == capsys.readouterr().out.splitlines()
    assert "numba" in modules.split()
    assert not COLD.intersection(modules.split())
