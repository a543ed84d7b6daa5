"""``make figures`` makes all pictures, ``make figures ARGS='page soda_can'`` some of them."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable, Sequence

from docs.figures import climbing, coordinates, holding, page, unwrapping
from docs.figures.architecture import architecture
from docs.figures.grids import grids
from docs.figures.style import IMAGES

__all__ = ["FIGURES", "main"]

FIGURES: dict[str, Callable[[], None]] = {
    figure.__name__: figure
    for figure in (
        architecture,
        holding.log_two_humanoids,
        holding.log_four_robots,
        coordinates.coordinates,
        unwrapping.soda_can,
        holding.wine_bottle,
        unwrapping.turn_shifts,
        unwrapping.maps_slide,
        climbing.handprints,
        holding.pick_pour_place,
        holding.tutorial,
        grids,
        page.page_plays,
        page.page,
        page.page_two_robots,
    )
}
"""Name → what makes the picture of that name: the rooms, then in the paper's order; the page comes last."""


def main(names: Sequence[str]) -> int:
    """Make pictures by name, or all; return 1 if one could not be made."""
    unknown = set(names) - set(FIGURES)
    if unknown:
        print(
            f"no such figure: {', '.join(sorted(unknown))}; there are {', '.join(FIGURES)}", file=sys.stderr
        )
        return 2
    IMAGES.mkdir(exist_ok=True)
    failed = []
    for name in names or FIGURES:
        start = time.perf_counter()
        try:
            FIGURES[name]()
        except Exception:  # one picture that fails leaves the others
            traceback.print_exc()
            failed.append(name)
        else:
            print(f"{name} ({time.perf_counter() - start:.0f} s)", flush=True)
    if failed:
        print(f"not made: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
