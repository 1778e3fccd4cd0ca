from __future__ import annotations

from collections.abc import Iterator

import pytest

from support.http_files import Files, served_files


@pytest.fixture
def files() -> Iterator[Files]:
    """Serve files over HTTP on loopback."""
    with served_files() as served:
        yield served
