"""A server behind its front door, and who loaded the page there."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import viser

from app.server.door.front_door import FrontDoor, Visit
from app.server.door.viser_server import any_port, quiet_server


class Visits(list[Visit]):
    def __call__(self, visit: Visit) -> bool:
        self.append(visit)
        return visit.token == "known"


@pytest.fixture
def visits() -> Visits:
    return Visits()


@pytest.fixture
def server(visits) -> Iterator[viser.ViserServer]:
    """A server with room for two browsers."""
    server = quiet_server(FrontDoor("127.0.0.1", any_port(), visits, 2))
    yield server
    server.stop()


@pytest.fixture
def port(server) -> int:
    return server.get_port()
