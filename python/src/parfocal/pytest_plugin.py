"""Fixtures for tests of one's own client or policy: a real server, and a lens with faults.

``@pytest.mark.parfocal(camera="phantom:still", fps=10)`` gives the server of a test other arguments.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from .errors import NoProgram

if TYPE_CHECKING:
    from .lens import EmulatedLens
    from .server import Server


def pytest_configure(config: pytest.Config) -> None:
    """Make the marker known."""
    config.addinivalue_line(
        "markers", "parfocal(**arguments): arguments of the fixture parfocal_server's Server"
    )


@pytest.fixture
def parfocal_lens() -> Iterator[EmulatedLens]:
    """Give an emulated lens, which `parfocal_server` then uses: ``parfocal_lens.fault("silent")``."""
    from .lens import EmulatedLens

    try:
        lens = EmulatedLens()
    except NoProgram as error:
        pytest.fail(str(error), pytrace=False)
    with lens:
        yield lens


@pytest.fixture
def parfocal_server(request: pytest.FixtureRequest) -> Iterator[Server]:
    """Give a running server with a folder of its own, simulated devices, and ten frames a second."""
    from .server import Server

    marker = request.node.get_closest_marker("parfocal")
    arguments = {"fps": 10, **(marker.kwargs if marker else {})}
    if "parfocal_lens" in request.fixturenames:
        arguments["lens"] = request.getfixturevalue("parfocal_lens")
    try:
        server = Server(**arguments)
    except NoProgram as error:
        pytest.fail(str(error), pytrace=False)
    with server:
        yield server
