"""The metrics of the edge agent, and the port on which Prometheus reads them.

Imported only if ``metrics.port`` is set, to save the robot's memory.
"""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from nena_edge_agent.agent import AgentSnapshot, RobotAgent
from nena_edge_agent.driver.port import DriveFailure, SessionState
from nena_edge_agent.extension import Extension
from nena_edge_agent.settings import MetricsSettings
from nena_shared.certificates import Certificates
from nena_shared.clock import Clock
from nena_shared.log import get_logger
from nena_shared.loop_lag import LoopLag
from nena_shared.metrics import (
    Exposition,
    Metric,
    MetricKind,
    Section,
    certificate_metrics,
    gauge,
)
from nena_shared.mqtt.link import LinkState
from nena_shared.tasks import StartError
from nena_shared.vda5050.error import ErrorLevel
from nena_shared.vda5050.topics import RobotKey

log = get_logger(__name__)

DISTRIBUTION = "nena-edge-agent"
ROBOT: Final = ("manufacturer", "serial_number")
HEAD_LIMIT = 8192
"""Maximum size of a request's head, bytes."""
REQUEST_TIMEOUT = 5.0
"""Timeout of a client's request, and of the disk's free space, seconds."""
CLIENTS = 10
"""Maximum number of simultaneous connections; further ones are closed at once."""


@dataclass(slots=True)
class Program:
    """The robots of the program, and what they share."""

    agents: Mapping[RobotKey, RobotAgent]
    clock: Clock
    loop_lag: LoopLag
    journal: Path | None
    """The folder of the journal."""
    certificates: Certificates = field(default_factory=Certificates)
    snapshots: Mapping[RobotKey, AgentSnapshot] = field(default_factory=dict)
    disk_free: float | None = None
    """Bytes left for the journal."""
    _disk_query: asyncio.Future[float | None] | None = None
    """The last query of the disk; no other one is started while it is pending."""

    async def refresh(self) -> None:
        """Read the values for a scrape; wait at most ``REQUEST_TIMEOUT`` s for a hanging disk."""
        self.snapshots = {robot: agent.snapshot() for robot, agent in self.agents.items()}
        if self.journal is None:
            return
        query = self._disk_query
        if query is None or query.done():
            query = asyncio.get_running_loop().run_in_executor(None, _free_bytes, self.journal)
            self._disk_query = query
        await asyncio.wait([query], timeout=REQUEST_TIMEOUT)
        self.disk_free = query.result() if query.done() else None


def _free_bytes(folder: Path) -> float | None:
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return None


Read = Callable[[Program, AgentSnapshot], Any]


def _of_robot(kind: MetricKind, name: str, text: str, read: Read, *labels: str) -> Metric[Program]:
    """Define a metric of each robot; ``read`` returns a value, or a mapping by ``labels``."""

    def values(program: Program) -> dict[tuple[str, ...], Any]:
        by_labels: dict[tuple[str, ...], Any] = {}
        for robot, snapshot in program.snapshots.items():
            value = read(program, snapshot)
            if isinstance(value, Mapping):
                by_labels |= {(*robot, str(label)): part for label, part in value.items()}
            elif value is not None:
                by_labels[robot.manufacturer, robot.serial_number] = value
        return by_labels

    return Metric(name, kind, text, (*ROBOT, *labels), values)


def _make_gauge(name: str, text: str, read: Read, *labels: str) -> Metric[Program]:
    return _of_robot(MetricKind.GAUGE, name, text, read, *labels)


def _make_counter(name: str, text: str, read: Read, *labels: str) -> Metric[Program]:
    return _of_robot(MetricKind.COUNTER, name, text, read, *labels)


def _pose_age(program: Program, snapshot: AgentSnapshot) -> float | None:
    at = snapshot.statistics.posed_at
    return None if at is None else max(0.0, program.clock.monotonic() - at)


def _read_link(read: Callable[[LinkState], float]) -> Read:
    return lambda _, snapshot: read(snapshot.link)


PROTOCOL: Final[Section[Program]] = Section(
    "Messages and broker",
    (
        _make_counter(
            "nena_agent_messages_total",
            "Messages of fleet control: `taken`, `malformed`, `repaired` (taken, but violates the standard), "
            "`misdirected` (to another robot), `retained` (possibly old: ignored), `dropped` (too many).",
            lambda _, v: {
                "taken": v.inbox.taken,
                "malformed": v.inbox.malformed,
                "repaired": v.inbox.repaired,
                "misdirected": v.inbox.misdirected,
                "retained": v.inbox.retained,
                "dropped": v.dropped,
            },
            "outcome",
        ),
        _make_gauge(
            "nena_agent_mqtt_connected", "1 while connected to the broker.", _read_link(lambda s: s.connected)
        ),
        _make_counter(
            "nena_agent_mqtt_connects_total", "Connections to the broker.", _read_link(lambda s: s.connects)
        ),
        _make_counter(
            "nena_agent_mqtt_published_total",
            "Messages acknowledged by the broker.",
            _read_link(lambda s: s.published),
        ),
        _make_counter(
            "nena_agent_mqtt_dropped_total",
            "Messages not sent: the queue was full, or the link was down.",
            _read_link(lambda s: s.dropped),
        ),
        _make_gauge(
            "nena_agent_fleet_clock_skew_seconds",
            "Clock of the order service minus the robot's, by the last orders; absent before the first.",
            lambda _, v: v.statistics.fleet_clock.seconds,
        ),
    ),
)

DRIVING: Final[Section[Program]] = Section(
    "Driving",
    (
        _make_counter(
            "nena_agent_drives_total",
            "Drives by result: `ARRIVED`, "
            + ", ".join(f"`{failure.value}`" for failure in DriveFailure)
            + ".",
            lambda _, v: {"ARRIVED": v.statistics.arrived} | v.statistics.failed,
            "result",
        ),
        _make_counter(
            "nena_agent_recoveries_total", "Recoveries of Nav2.", lambda _, v: v.statistics.recoveries
        ),
        _make_gauge(
            "nena_agent_ros_session",
            "1 for the state of the ROS session: "
            + ", ".join(f"`{state.value}`" for state in SessionState)
            + ".",
            lambda _, v: {v.statistics.session: 1} if v.statistics.session else None,
            "state",
        ),
        _make_gauge(
            "nena_agent_localized",
            "1 while the robot is localised; 0 also if no pose arrives while it drives. Absent before the "
            "first pose.",
            lambda _, v: v.statistics.localized,
        ),
        _make_gauge(
            "nena_agent_pose_age_seconds",
            "Time since the last valid pose; absent before the first. AMCL sends none at standstill.",
            _pose_age,
        ),
        _make_gauge(
            "nena_agent_errors",
            "Active errors of the robot's state.",
            lambda _, v: {
                level.value: sum(error.error_level is level for error in v.errors) for level in ErrorLevel
            },
            "error_level",
        ),
    ),
)

DISK: Final[Section[Program]] = Section(
    "Journal and program",
    (
        gauge("nena_build_info", "Always 1.", lambda _: {version(DISTRIBUTION): 1}, "version"),
        _make_gauge(
            "nena_agent_journal_works",
            "1 while orders and actions are written to disk; 0: nothing new is started. Absent without a "
            "journal.",
            lambda program, v: None if program.journal is None else not v.journal_problem,
        ),
        _of_robot(
            MetricKind.HISTOGRAM,
            "nena_agent_journal_seconds",
            "Time to write a record durably, so that it survives a power failure.",
            lambda _, v: v.journal_seconds,
        ),
        gauge(
            "nena_agent_disk_free_bytes",
            "Free space on the journal's disk; absent without a journal, or if the disk does not respond.",
            lambda s: s.disk_free,
        ),
        *certificate_metrics(lambda s: s.certificates),
        gauge(
            "nena_event_loop_lag_seconds",
            "Longest delay of the event loop in the last minute.",
            lambda s: s.loop_lag.longest,
        ),
    ),
)

SECTIONS: Final = (PROTOCOL, DRIVING, DISK)


class MetricsServer:
    """Serves ``GET /metrics`` only; HTTP 1.1, one request per connection."""

    def __init__(
        self, settings: MetricsSettings, program: Program, extensions: Iterable[Extension] = ()
    ) -> None:
        self._settings = settings
        self._program = program
        self._expositions = [Exposition(program, SECTIONS)]
        self._expositions += [
            # The metrics of the process are in the first exposition.
            Exposition(extension, [section], process=False)
            for extension in extensions
            if (section := extension.metrics())
        ]
        self._clients = 0

    async def run(self) -> None:
        """Serve until cancelled.

        Raises:
            StartError: the port is in use, or the address does not belong to this machine.
        """
        host, port = self._settings.host, self._settings.port
        try:
            server = await asyncio.start_server(self._serve_client, host, port, limit=HEAD_LIMIT)
        except OSError as error:
            raise StartError(
                f"metrics.host, metrics.port: cannot listen on {host}:{port}: {error.strerror or error}"
            ) from error
        log.info("metrics listening", url=f"http://{host}:{server.sockets[0].getsockname()[1]}/metrics")
        async with server:
            await server.serve_forever()

    async def _serve_client(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._clients += 1
        try:
            if self._clients <= CLIENTS:
                # Once for the request, and once for a disk that hangs.
                async with asyncio.timeout(2 * REQUEST_TIMEOUT):
                    head = await reader.readuntil(b"\r\n\r\n")
                    writer.write(await self._answer_request(head.split(b"\r\n", 1)[0].split(b" ")))
                    await writer.drain()
        except (OSError, TimeoutError, asyncio.IncompleteReadError, asyncio.LimitOverrunError):
            log.debug("metrics request aborted")
        finally:
            self._clients -= 1
            writer.close()

    async def _answer_request(self, request: list[bytes]) -> bytes:
        match request:
            case [b"GET", b"/metrics", _]:
                await self._program.refresh()
                return _make_response(
                    "200 OK", b"".join(exposition.text() for exposition in self._expositions)
                )
            case [b"GET", _, _]:
                return _make_response("404 Not Found", b"Not found; see /metrics.\n")
            case _:
                return _make_response("405 Method Not Allowed", b"Only GET is answered.\n")


def _make_response(status: str, body: bytes) -> bytes:
    head = (
        f"HTTP/1.1 {status}\r\nContent-Type: text/plain; version=0.0.4; charset=utf-8\r\n"
        f"Content-Length: {len(body)}\r\nConnection: close\r\n\r\n"
    )
    return head.encode() + body
