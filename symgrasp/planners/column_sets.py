"""Sets of columns of the grid, as words of bits. Compiled.

Those that are read from any column on are written twice in a row: `doubled_words` words.
"""

from __future__ import annotations

import numpy as np

from symgrasp.compiling import njit
from symgrasp.ik.vectors import STRICT

__all__ = [
    "WORD",
    "copy_set",
    "doubled",
    "doubled_words",
    "fill_above",
    "intersect",
    "take_first",
    "word_count",
]

WORD = 64
"""Bits of a word."""


def word_count(angles: int) -> int:
    """Return how many words a set of columns has."""
    return (angles + WORD - 1) // WORD


def doubled_words(angles: int) -> int:
    """Return how many words a set has that is written twice in a row."""
    return 2 * word_count(angles) + 1


def doubled(inside: np.ndarray) -> np.ndarray:
    """Return sets (..., doubled_words), written twice in a row, of where ``inside`` (..., A) is true."""
    angles = inside.shape[-1]
    bits = np.zeros((*inside.shape[:-1], WORD * doubled_words(angles)), dtype=np.uint8)
    bits[..., : 2 * angles] = np.concatenate([inside, inside], axis=-1)
    return np.packbits(bits, axis=-1, bitorder="little").view("<u8").astype(np.uint64)


@njit(**STRICT)
def copy_set(bits, out):
    """Copy a set."""
    for w in range(len(bits)):
        out[w] = bits[w]


@njit(**STRICT)
def fill_above(bits, values, floor):
    """Write the set of columns whose value is above the floor, twice in a row."""
    for w in range(len(bits)):
        bits[w] = 0
    angles = len(values)
    for j in range(angles):
        if values[j] > floor:
            for k in (j, j + angles):
                bits[k // WORD] |= np.uint64(1) << np.uint64(k % WORD)


@njit(**STRICT)
def intersect(own, other, first, both):
    """Write what a set shares with another one read from column ``first``; tell whether it is anything."""
    i, shift = first // WORD, np.uint64(first % WORD)
    anything = False
    for w in range(len(own)):
        bits = other[i + w] >> shift
        if shift:
            bits |= other[i + w + 1] << (np.uint64(WORD) - shift)
        both[w] = own[w] & bits
        anything |= both[w] != 0
    return anything


@njit(**STRICT)
def take_first(bits):
    """Take the first column out of a set and return it, or -1 if the set is empty."""
    for w in range(len(bits)):
        if bits[w]:
            low = bits[w] & (~bits[w] + np.uint64(1))
            bits[w] ^= low
            place = 0
            for step in (32, 16, 8, 4, 2, 1):
                if low >> np.uint64(step):
                    low >>= np.uint64(step)
                    place += step
            return WORD * w + place
    return -1
