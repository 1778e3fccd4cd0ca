"""Instant actions that callers wait for."""

from __future__ import annotations

import asyncio

from nena_order_service.fleet import InstantActionEnded
from nena_order_service.fleet.mission import fresh_id
from nena_shared.vda5050.action import Action, BlockingType


def state_request() -> Action:
    """Make the instant action that asks a robot for its state (VDA 5050 3.0 section 6.2.3)."""
    return Action(action_type="stateRequest", action_id=fresh_id(), blocking_type=BlockingType.NONE)


class PendingInstantActions:
    """Hands the end of each instant action to whoever waits for it; nobody may have to."""

    def __init__(self) -> None:
        self._waiting: dict[str, asyncio.Future[InstantActionEnded]] = {}

    def ended(self, end: InstantActionEnded) -> None:
        """Tell the end of an action."""
        waiting = self._waiting.pop(end.action.action_id, None)
        if waiting and not waiting.done():
            waiting.set_result(end)

    def expect(self, action_id: str) -> asyncio.Future[InstantActionEnded]:
        """Give a future of the end of an action that is about to be sent."""
        return self._waiting.setdefault(action_id, asyncio.get_running_loop().create_future())

    async def wait(
        self, action_id: str, end: asyncio.Future[InstantActionEnded], seconds: float
    ) -> InstantActionEnded | None:
        """Wait at most ``seconds`` for the end of an action; None if it has not come."""
        try:
            async with asyncio.timeout(seconds):
                return await end
        except TimeoutError:
            return None
        finally:
            self._waiting.pop(action_id, None)
