"""A server for the tests of sessions, one for each of their modules."""

from collections.abc import Iterator

import pytest

from tests.app.server.session.served import Server, start_server


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with start_server() as server:
        yield server
