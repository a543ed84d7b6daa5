"""Imported by the process that those which compute are copied from: what all of them need, and share.

Nothing here may start a thread or open a physics world: a copy would have them only half.
"""

import gc

import numba

from . import process_main

__all__ = ["process_main"]

numba.njit(lambda: 0)()  # sets up the compiler's tables, some 20 MB

# The garbage collector writes into every object that it looks at, which would copy the memory after all.
gc.collect()
gc.freeze()
