"""What a process may take, and how it is known that it took too much."""

from __future__ import annotations

import subprocess
import sys

import pytest

from app.compute.limits import MEMORY_LIMIT, ran_out_of_memory
from symgrasp.errors import MeshError

TAKE = """
import sys
import numpy as np
from app.compute.limits import limit_memory
limit_memory()
np.zeros(int(sys.argv[1]), dtype=np.uint8)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="no other system limits the memory of a process")
@pytest.mark.parametrize(("share", "fits"), [(0.9, True), (1.1, False)])
def test_a_process_gets_as_much_memory_as_it_may_take_and_no_more(share, fits):
    taken = subprocess.run(
        [sys.executable, "-c", TAKE, str(int(share * MEMORY_LIMIT))],
        check=False,
        capture_output=True,
        text=True,
    )
    assert (taken.returncode == 0) == fits
    assert fits or "MemoryError" in taken.stderr


def test_a_lack_of_memory_is_known_behind_other_errors():
    def read() -> None:
        try:
            raise MemoryError
        except Exception as error:
            raise MeshError("a.stl", "content", str(error), "a mesh") from None

    with pytest.raises(MeshError) as lacking:
        read()
    assert ran_out_of_memory(lacking.value)
    assert ran_out_of_memory(MemoryError())
    assert not ran_out_of_memory(MeshError("a.stl", "content", "", "a mesh"))
