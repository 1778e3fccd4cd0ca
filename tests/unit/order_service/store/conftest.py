from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from nena_order_service.store.database import open_database
from nena_order_service.store.store import Store


@pytest.fixture
def url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path}/orders.db"


@pytest.fixture
def make_store(url: str) -> Iterator[Callable[[], Store]]:
    """Open the same store again and again, as restarts do."""
    stores: list[Store] = []

    def make() -> Store:
        stores.append(Store(open_database(url)))
        return stores[-1]

    yield make
    for store in stores:
        store.close()
