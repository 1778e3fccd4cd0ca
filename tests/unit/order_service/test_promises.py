from __future__ import annotations

import pytest

from nena_order_service.api.host_requests import committed, require_store
from nena_order_service.engine.engine import UnitOfWork
from nena_order_service.errors import StoreNotReadyError
from nena_order_service.store.store import Store
from support.scripted_fleet import make_state


class SilentStore(Store):
    """Takes everything, and is never done."""

    def __init__(self) -> None:
        self.problem = self.lead_problem = self._loss = ""
        self._lock = None
        self._then = []
        self._answers = set()

    def commit(self, *_: object) -> None:
        pass


async def test_nothing_is_promised_that_the_store_has_not_taken() -> None:
    store = SilentStore()
    require_store(store)
    with pytest.raises(StoreNotReadyError):
        await committed(UnitOfWork(make_state(), store, lambda _: None, lambda _: None), store, 0.01)
    store.problem = "disk full"
    with pytest.raises(StoreNotReadyError, match="disk full"):
        require_store(store)
