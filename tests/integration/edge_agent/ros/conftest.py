from __future__ import annotations

from collections.abc import Iterator

import pytest

from support.ros import RosPeer, own_domain_id


@pytest.fixture
def domain_id() -> Iterator[int]:
    with own_domain_id() as reserved:
        yield reserved


@pytest.fixture
def other_domain_id() -> Iterator[int]:
    with own_domain_id() as reserved:
        yield reserved


@pytest.fixture
def peer(domain_id: int) -> Iterator[RosPeer]:
    with RosPeer(domain_id) as node:
        yield node
