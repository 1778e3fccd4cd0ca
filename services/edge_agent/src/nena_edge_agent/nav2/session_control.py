"""The life cycle of the robot's ROS session: environment, start, stop, retries, and its stored address.

Nothing here imports rclpy.
"""

from __future__ import annotations

import atexit
import ctypes
import os
import shutil
import tempfile
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from nena_edge_agent.nav2.session import RosSession
import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from urllib.parse import quote

from pydantic import BaseModel, ConfigDict, ValidationError

from nena_edge_agent.driver.port import SessionError, SessionReport, SessionState
from nena_edge_agent.durability import sync_folder
from nena_edge_agent.nav2.settings import RosAddress, RosSettings
from nena_shared.clock import Clock
from nena_shared.findings import shortened
from nena_shared.log import get_logger
from nena_shared.vda5050.topics import RobotKey

M_ARENA_MAX = -8
"""Parameter of glibc's mallopt: maximum number of memory pools."""
POOLS = 2


def prepare_environment() -> None:
    """Set up this process for rclpy; variables that the user has set are kept.

    Fast DDS uses UDP only, because the shared memory of a killed process can block others forever. Message
    fields check their types, because a number of the wrong type would be sent as garbage. rclpy's log files
    go to a directory that is removed when the program ends. Threads share memory pools, because each new
    session would otherwise fill pools of its own, some megabytes in all.
    """
    # glibc's equivalent of MALLOC_ARENA_MAX; other C libraries have none.
    if "MALLOC_ARENA_MAX" not in os.environ and hasattr(own := ctypes.CDLL(None), "mallopt"):
        own.mallopt(M_ARENA_MAX, POOLS)
    # eProsima/Fast-DDS #6485: a shared memory port of a killed process can lock its neighbours.
    os.environ.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
    # rclpy reads the memory of any object in a float field as a double: 3 arrives as 5e-324.
    os.environ.setdefault("ROS_PYTHON_CHECK_FIELDS", "1")
    # Without HOME, rclpy.init fails unless ROS_LOG_DIR is set; each process writes a file there.
    if "ROS_LOG_DIR" not in os.environ:
        directory = tempfile.mkdtemp(prefix="nena-edge-agent-ros-log-")
        atexit.register(shutil.rmtree, directory, ignore_errors=True)
        os.environ["ROS_LOG_DIR"] = directory


class NodeExtension(Protocol):
    """An extension of every node that the agent creates; the session shows whether the node still exists."""

    def enter(self, session: RosSession, node: Any) -> None:  # noqa: ANN401 - rclpy carries no types
        """Set up a new node, in the ROS thread, before its callbacks run."""
        ...


log = get_logger(__name__)

LONGEST_RETRY = 60.0
"""Maximum interval between two attempts to start, seconds."""


class SessionManager:
    """Starts, stops and moves the ROS session; each call waits for the previous one to finish.

    ``begin`` joins the graph at an address, or raises :class:`SessionError`; ``end`` leaves it, and is called
    only after ``begin`` has succeeded. ``on_change`` is called after each change.
    """

    def __init__(
        self,
        address: RosAddress,
        *,
        begin: Callable[[RosAddress], Awaitable[None]],
        end: Callable[[], Awaitable[None]],
        on_change: Callable[[SessionReport], None],
        clock: Clock,
        retry: float,
    ) -> None:
        """Prepare; ``retry``: seconds before the second attempt to start."""
        self.address = address
        self.state = SessionState.NOT_ACTIVE
        self.reason = ""
        self.step = asyncio.Lock()
        """Held while the session begins or ends, and by code that needs it unchanged."""
        self._begin = begin
        self._end = end
        self._on_change = on_change
        self._clock = clock
        self._retry = retry
        self._tries = 0
        self._again_at = 0.0

    @property
    def wanted(self) -> bool:
        """Return whether the session is active or is restarted automatically."""
        return self.state is not SessionState.NOT_ACTIVE

    def report_stopped(self) -> None:
        """Report that the session waits to be started."""
        self._change_state(SessionState.NOT_ACTIVE)

    async def start(self) -> None:
        """Start the session, unless it is active.

        Raises:
            SessionError: it cannot start now; retried until it is stopped.
        """
        async with self.step:
            if self.state is not SessionState.ACTIVE:
                await self._open_session()

    async def stop(self) -> None:
        """End the session, or the attempts to start it."""
        async with self.step:
            await self._close_session()

    async def move(self, address: RosAddress) -> None:
        """Move to another address in the ROS graph; a wanted session is restarted there.

        Raises:
            SessionError: as for :meth:`start`; the new address is kept.
        """
        async with self.step:
            wanted = self.wanted
            await self._close_session()
            self.address = address
            if wanted:
                await self._open_session()
            else:
                self.report_stopped()

    async def retry_failed(self) -> None:
        """Retry after a failure, if due."""
        if self.state is not SessionState.FAILED or self._clock.monotonic() < self._again_at:
            return
        async with self.step:
            if self.state is SessionState.FAILED:  # a command may have started it meanwhile
                try:
                    await self._open_session()
                except SessionError as error:
                    log.warning("ROS session could not start", address=str(self.address), reason=error.reason)

    def failed(self, reason: str) -> None:
        """Record that the session has ended unexpectedly."""
        if self.state is SessionState.ACTIVE:
            self._again_at = self._clock.monotonic()
            self._change_state(SessionState.FAILED, reason)

    async def _open_session(self) -> None:
        self._change_state(SessionState.INITIATING)
        try:
            await self._begin(self.address)
        except SessionError as error:
            pause = min(self._retry * 2.0**self._tries, LONGEST_RETRY)
            self._tries += 1
            self._again_at = self._clock.monotonic() + pause
            self._change_state(SessionState.FAILED, error.reason)
            raise
        except BaseException:
            self._change_state(SessionState.NOT_ACTIVE)
            raise
        self._tries = 0
        self._change_state(SessionState.ACTIVE)

    async def _close_session(self) -> None:
        if self.state is SessionState.ACTIVE:
            self._change_state(SessionState.TERMINATING)
            await self._end()
        self._tries = 0
        if self.wanted:
            self._change_state(SessionState.NOT_ACTIVE)

    def _change_state(self, state: SessionState, reason: str = "") -> None:
        self.state, self.reason = state, reason
        log.info("ROS session", state=state.value, address=str(self.address), reason=reason)
        self._on_change(SessionReport(state, self.address.namespace, self.address.domain_id, reason))


class _Record(BaseModel):
    """The stored address, and the one of the settings that it replaces."""

    model_config = ConfigDict(frozen=True)

    address: RosAddress
    instead_of: RosAddress


class SessionStore:
    """The stored ROS address of one robot; it is valid until the address in the settings changes."""

    def __init__(self, folder: Path, robot: RobotKey) -> None:
        """Prepare; the folder may not exist yet."""
        self._file = folder.expanduser() / f"{quote(str(robot), safe='')}.ros.json"

    def read(self, settings: RosSettings) -> RosAddress:
        """Return the stored address, or that of the settings without a valid stored one."""
        own = RosAddress.of(settings)
        try:
            record = _Record.model_validate_json(self._file.read_bytes())
        except FileNotFoundError:
            return own
        except (OSError, ValidationError) as error:
            log.warning(
                "the stored ROS address is unreadable", file=str(self._file), reason=shortened(str(error))
            )
            return own
        if record.instead_of != own:
            log.warning("ignoring the stored ROS address: the settings have changed", settings=str(own))
            return own
        log.info("using the stored ROS address", file=str(self._file), address=str(record.address))
        return record.address

    def write(self, address: RosAddress, settings: RosSettings) -> None:
        """Store ``address`` in place of that of ``settings``; on return it survives a power failure.

        Raises:
            OSError: it could not be written; the stored one is kept.
        """
        record = _Record(address=address, instead_of=RosAddress.of(settings))
        self._file.parent.mkdir(parents=True, exist_ok=True)
        new = self._file.with_suffix(".new")
        with new.open("wb") as file:
            file.write(record.model_dump_json().encode())
            file.flush()
            os.fsync(file.fileno())
        new.replace(self._file)
        sync_folder(self._file.parent)
