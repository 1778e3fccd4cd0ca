"""What each answer to a host hangs on: that the store takes things, and has taken what is answered."""

from __future__ import annotations

import asyncio

from nena_order_service.errors import StoreNotReadyError
from nena_order_service.kernel.steps import Steps
from nena_order_service.store.store import Store


def require_store(store: Store) -> None:
    """See to it that the store takes things at present; raises StoreNotReadyError."""
    if not store.ready:
        raise StoreNotReadyError(store.why_not_ready)


async def committed(steps: Steps, store: Store, seconds: float) -> None:
    """Wait until all that has been changed so far is committed; raises StoreNotReadyError."""
    try:
        async with asyncio.timeout(seconds):
            await steps.committed()
    except TimeoutError:
        raise StoreNotReadyError(store.why_not_answered) from None
