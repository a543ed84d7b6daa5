"""Pictures for files: names in them are text."""

from __future__ import annotations

import warnings
from dataclasses import replace
from xml.etree import ElementTree

import pytest
from matplotlib import rc_context

from symgrasp.errors import printable
from symgrasp.feasibility.create import create_map
from symgrasp.feasibility.fit import plot_openings
from symgrasp.feasibility.object_report import describe_object
from symgrasp.feasibility.pictures import to_png, to_svg
from symgrasp.object.profile import Profile
from symgrasp.robot.hand import HANDS
from tests.conftest import load_small
from tests.hostile_names import HOSTILE_NAMES

PROFILE = Profile([[0, 0.02], [0.1, 0.02]])


@pytest.mark.parametrize("name", HOSTILE_NAMES.values(), ids=HOSTILE_NAMES)
@pytest.mark.parametrize("kind", ["map", "object", "openings"])
def test_names_are_drawn_as_they_are(kind, name):
    if kind == "map":
        figure = replace(create_map(load_small("soda_can")), scene=name).plot()
    elif kind == "object":
        figure = replace(describe_object("can_330ml"), name=name).plot()
    else:
        figure = plot_openings(PROFILE, {name: HANDS["franka"]})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert to_png(figure).startswith(b"\x89PNG")
        with rc_context({"svg.fonttype": "none"}):
            svg = ElementTree.fromstring(to_svg(figure))
    drawn = ["".join(text.itertext()) for text in svg.iter("{http://www.w3.org/2000/svg}text")]
    shown = printable(name)
    if len(shown) > 30:  # as much as there is room for
        shown = shown[:10]
    assert any(shown in text for text in drawn), drawn
