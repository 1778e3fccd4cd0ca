from __future__ import annotations

import pytest

from nena_order_service.engine.unit_of_work import UnitOfWork
from nena_order_service.errors import StoreNotReadyError
from nena_order_service.store.database import Changes
from nena_order_service.store.store import Store
from support.scripted_fleet import make_state


class SilentStore(Store):
    """Accepts everything, and never completes."""

    def __init__(self) -> None:
        self.problem = self.lead_problem = self._loss = ""
        self._lock = None
        self._then = []
        self._answers = set()

    def commit(self, *_: object) -> None:
        pass


async def test_nothing_is_acknowledged_before_the_commit() -> None:
    store = SilentStore()
    unit_of_work = UnitOfWork(make_state(), store, lambda _: None, lambda _: None, timeout=0.01)
    unit_of_work.require_store()
    with pytest.raises(StoreNotReadyError, match="in time"):
        await unit_of_work.wait_committed()
    with pytest.raises(StoreNotReadyError):
        await unit_of_work.commit(Changes(), lambda: None)
    store.problem = "disk full"
    with pytest.raises(StoreNotReadyError, match="disk full"):
        unit_of_work.require_store()
