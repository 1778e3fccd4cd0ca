"""Run a NeNa program: settings, logging, signals, and heartbeats for its supervisor."""

from __future__ import annotations

import asyncio
import gc
import os
import socket
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

from nena_shared.log import configure, get_logger
from nena_shared.settings import ConfigurationError, HasSettings, S, load, settings_with
from nena_shared.tasks import StartError, TaskFailedError, end, set_within, stop_on_signals

log = get_logger(__name__)

BEAT = 5.0
"""Maximum interval between heartbeats, seconds; shorter if systemd requires it."""

HEARTBEAT_FILE = "NENA_HEARTBEAT_FILE"
"""Environment variable with the path of the heartbeat file; its modification time is the last heartbeat."""


@dataclass(frozen=True, slots=True)
class Supervision:
    """The supervisor that expects a heartbeat every ``period`` seconds."""

    notify_socket: str | None
    file: Path | None
    period: float

    @classmethod
    def of(cls, environment: Mapping[str, str]) -> Supervision:
        """Read the environment variables of systemd (sd_notify(3), sd_watchdog_enabled(3)) and NeNa."""
        file = environment.get(HEARTBEAT_FILE)
        watchdog = environment.get("WATCHDOG_USEC", "")
        seconds = int(watchdog) / 1e6 if watchdog.isdecimal() and int(watchdog) else 2 * BEAT
        # half the period, as sd_watchdog_enabled(3) recommends
        return cls(environment.get("NOTIFY_SOCKET"), Path(file) if file else None, min(BEAT, seconds / 2))

    def notify(self, text: str) -> None:
        """Send ``text`` to systemd as in sd_notify(3); raises OSError if the socket no longer exists."""
        if self.notify_socket is None:
            return
        address = self.notify_socket
        # does not block: systemd may not read for a while, and the next heartbeat tries again
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as sender:
            # "@" stands for the zero byte of the abstract namespace (sd_notify(3))
            sender.sendto(text.encode(), "\0" + address[1:] if address.startswith("@") else address)

    def beat(self) -> None:
        """Send a heartbeat; raises like :meth:`notify`."""
        self.notify("WATCHDOG=1")
        if self.file:
            self.file.touch()


@asynccontextmanager
async def heartbeats(stop: asyncio.Event, environment: Mapping[str, str] = os.environ) -> AsyncIterator[None]:
    """Notify the supervisor that the program is ready, alive and, once ``stop`` is set, ending."""
    supervision = Supervision.of(environment)
    if supervision.notify_socket is None and supervision.file is None:
        yield
        return
    work = asyncio.create_task(_send_heartbeats(supervision, stop), name="heartbeats")
    try:
        yield
    finally:
        await end(work)


async def _send_heartbeats(supervision: Supervision, stop: asyncio.Event) -> None:
    """Send heartbeats until cancelled, including during a long shutdown.

    Each message is sent until it succeeds: without READY=1 systemd would restart the service.
    """
    message, stopping, well = "READY=1", False, True
    while True:
        try:
            if message:
                supervision.notify(message)
                message = ""
            supervision.beat()
            well = True
        except OSError as error:
            if well:
                log.warning("cannot notify the watchdog", reason=str(error))
            well = False
        await (asyncio.sleep(supervision.period) if stopping else set_within(stop, supervision.period))
        if stop.is_set() and not stopping:
            message, stopping = "STOPPING=1", True


EXIT_FAILED = 1
# the systemd units do not restart a program that ends with it
EXIT_MISCONFIGURED = 2


def run(
    settings: type[S],
    serve: Callable[[S, asyncio.Event], Awaitable[None]],
    *,
    program: str,
    description: str,
    argv: Sequence[str] | None = None,
    loop_factory: Callable[[], asyncio.AbstractEventLoop] | None = None,
    extensions: Callable[[], Mapping[str, type[HasSettings]]] = dict,
) -> int:
    """Read the settings, run ``serve`` until SIGINT or SIGTERM, and return the exit status.

    ``serve`` receives the settings, with those of the ``extensions``, and an event that is set when the
    program must end. Without a ``loop_factory``, asyncio's event loop is used.
    """
    try:
        model = settings_with(settings, extensions())
        chosen = load(model, sys.argv[1:] if argv is None else argv, program=program, description=description)
        configure(chosen.log)
        with asyncio.Runner(loop_factory=loop_factory) as runner:
            runner.run(_serve_until_stopped(chosen, serve))
        get_logger(__name__).info("program ended", program=program)
    except ConfigurationError as error:
        return report_misconfigured(program, error)
    except (StartError, TaskFailedError) as error:
        text = f"{error}: {error.__cause__}" if isinstance(error.__cause__, StartError) else str(error)
        sys.stderr.write(f"{program}: {text}\n")
        return EXIT_FAILED
    return 0


def report_misconfigured(program: str, error: ConfigurationError) -> int:
    """Write the problems of the settings to standard error; return the exit status."""
    for problem in error.problems:
        sys.stderr.write(f"{program}: setting {problem}\n")
    return EXIT_MISCONFIGURED


async def _serve_until_stopped(settings: S, serve: Callable[[S, asyncio.Event], Awaitable[None]]) -> None:
    stop = asyncio.Event()
    stop_on_signals(stop)
    gc.freeze()  # modules stay: each full garbage collection would search them, which holds a robot for 30 ms
    async with heartbeats(stop):
        await serve(settings, stop)
