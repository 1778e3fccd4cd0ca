from __future__ import annotations

from collections.abc import Iterator

import pytest

from support.ros import RosPeer


@pytest.fixture
def peer(domain_id: int) -> Iterator[RosPeer]:
    with RosPeer(domain_id) as node:
        yield node
