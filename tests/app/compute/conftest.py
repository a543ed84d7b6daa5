"""The planners of a session's process, in this one."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from app.compute.map_service import MapService
from app.compute.plan_service import PlanService
from symgrasp.files import SCENES_DIR


@pytest.fixture
def plans() -> Iterator[PlanService]:
    maps = MapService()
    plans = PlanService(maps, (SCENES_DIR,))
    yield plans
    plans.close()
    maps.close()
