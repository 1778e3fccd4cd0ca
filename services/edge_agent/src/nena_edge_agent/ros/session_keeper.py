"""The life of a robot's ROS session: begun and ended on request, and begun again after a failure."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable

from nena_edge_agent.driver.port import SessionReport
from nena_edge_agent.ros.address import RosAddress
from nena_edge_agent.ros.session_state import SessionError, SessionState
from nena_shared.clock import Clock
from nena_shared.log import get_logger

log = get_logger(__name__)

LONGEST_RETRY = 60.0
"""Seconds between two tries to begin at most."""


class SessionKeeper:
    """One step at a time: who asks for the next one waits for the end of the one before.

    ``begin`` joins the graph at an address, or raises :class:`SessionError`; ``end`` leaves it, and is asked
    only after ``begin`` has succeeded. Each change is told by ``tell``.
    """

    def __init__(
        self,
        address: RosAddress,
        *,
        begin: Callable[[RosAddress], Awaitable[None]],
        end: Callable[[], Awaitable[None]],
        tell: Callable[[SessionReport], None],
        clock: Clock,
        retry: float,
    ) -> None:
        """Prepare; ``retry``: seconds before the second try to begin."""
        self.address = address
        self.state = SessionState.NOT_ACTIVE
        self.reason = ""
        self.step = asyncio.Lock()
        """Held while the session begins or ends, and by whoever needs it to stay as it is."""
        self._begin = begin
        self._end = end
        self._tell = tell
        self._clock = clock
        self._retry = retry
        self._tries = 0
        self._again_at = 0.0

    @property
    def wanted(self) -> bool:
        """Whether the session is there or is to come back by itself."""
        return self.state is not SessionState.NOT_ACTIVE

    def tell_off(self) -> None:
        """Tell that the session waits for somebody to start it."""
        self._become(SessionState.NOT_ACTIVE)

    async def start(self) -> None:
        """Begin the session, unless it is active.

        Raises:
            SessionError: it cannot begin now; it is tried again until somebody stops it.

        """
        async with self.step:
            if self.state is not SessionState.ACTIVE:
                await self._open()

    async def stop(self) -> None:
        """End the session, or the tries to begin it."""
        async with self.step:
            await self._close()

    async def move(self, address: RosAddress) -> None:
        """Be somewhere else in the graph from now on; a session that is wanted begins anew there.

        Raises:
            SessionError: as for :meth:`start`; the address stays the new one.

        """
        async with self.step:
            wanted = self.wanted
            await self._close()
            self.address = address
            if wanted:
                await self._open()
            else:
                self.tell_off()

    async def look(self) -> None:
        """Try again what has failed, if it is time to."""
        if self.state is not SessionState.FAILED or self._clock.monotonic() < self._again_at:
            return
        async with self.step:
            if self.state is SessionState.FAILED:
                await self._try()

    def failed(self, reason: str) -> None:
        """Take in that the session has ended although nobody has asked it to."""
        if self.state is SessionState.ACTIVE:
            self._again_at = self._clock.monotonic()
            self._become(SessionState.FAILED, reason)

    async def _try(self) -> None:
        try:
            await self._open()
        except SessionError as error:
            log.warning("ROS session does not begin", address=str(self.address), reason=error.reason)

    async def _open(self) -> None:
        self._become(SessionState.INITIATING)
        try:
            await self._begin(self.address)
        except SessionError as error:
            pause = min(self._retry * 2.0**self._tries, LONGEST_RETRY)
            self._tries += 1
            self._again_at = self._clock.monotonic() + pause
            self._become(SessionState.FAILED, error.reason)
            raise
        except BaseException:
            self._become(SessionState.NOT_ACTIVE)
            raise
        self._tries = 0
        self._become(SessionState.ACTIVE)

    async def _close(self) -> None:
        if self.state is SessionState.ACTIVE:
            self._become(SessionState.TERMINATING)
            await self._end()
        self._tries = 0
        if self.wanted:
            self._become(SessionState.NOT_ACTIVE)

    def _become(self, state: SessionState, reason: str = "") -> None:
        self.state, self.reason = state, reason
        log.info("ROS session", state=state.value, address=str(self.address), reason=reason)
        self._tell(SessionReport(state, self.address.namespace, self.address.domain_id, reason))
