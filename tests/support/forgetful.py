"""Work that loses a cancellation, as ``asyncio.wait_for`` of Python 3.11 sometimes does."""

from __future__ import annotations

import asyncio
from contextlib import suppress

import pytest

from nena_shared.tasks import end


async def forgetful(*_: object) -> None:
    """Run forever; only the second cancellation ends it."""
    with suppress(asyncio.CancelledError):
        await asyncio.Event().wait()
    await asyncio.Event().wait()


def cancel_again_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Allow no time for a graceful shutdown, so that tests need not wait for it."""
    defaults = end.__kwdefaults__
    assert defaults
    monkeypatch.setitem(defaults, "again_after", 0.01)
