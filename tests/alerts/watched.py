"""A whole site in separate processes, watched by a real Prometheus and a real Alertmanager."""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from collections.abc import AsyncIterator, Mapping
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

from faults.hall import start_of
from faults.site import Layout, Site
from support.alertmanager import Alertmanager, Labels, Notice
from support.broker import free_port
from support.programs import Program
from support.prometheus import UNHURRIED, Prometheus, eventually
from support.reference import PROJECT
from support.waiting import PATIENCE, awaited

WITHIN = float(os.environ.get("NENA_ALERT_WITHIN", PATIENCE))
"""Seconds from a fault to its alert. `make alerts-test` sets 15; other runs may share a slow machine."""
OVER_WITHIN = PATIENCE
"""Seconds from the end of a fault to the end of its alerts."""
LOOK_EVERY = 0.1
"""Seconds."""
FILE = PROJECT / "build" / "alerts.jsonl"
"""Seconds from each fault to the last of each of its alerts, one line per fault."""
JAM_SECONDS = 1
"""Instead of 60: it is a setting of the aggregator, no part of the rules."""
SINGLE = "single-1"
"""The robot in a program of its own."""
RECORDED = """
[black_box]
enabled = true
[upload]
enabled = true
folder = "{folder}/outgoing"
"""


class WatchedSite(Site):
    """Loopback robots in one program, and one with a black box in a program of its own; all have metrics."""

    def __init__(self, folder: Path, layout: Layout, **environments: Mapping[str, str]) -> None:
        """Prepare it; ``environments``: of single programs, by name."""
        super().__init__(folder, layout)
        self._environments = environments
        self._metrics_ports = {"loop": free_port(), SINGLE: free_port()}
        self.single_journal = folder / "single-journal"
        self.recordings = folder / "recordings"
        """Where the aggregator keeps recordings."""

    async def start(self) -> None:
        """Start everything, and wait until every robot can accept an order."""
        self.start_single_robot()
        await super().start()
        await self.robots_are("ONLINE", SINGLE)

    def start_single_robot(self) -> Program:
        """Start the robot that has a program of its own."""
        return self.start_single(SINGLE, at=start_of(self._layout.loopback), machine=SINGLE)

    def start_aggregator(self) -> Program:
        """Start the status aggregator, which reports a jam after a second."""
        return self._program(
            "aggregator",
            "nena-status-aggregator",
            *("--http.port", self._ports["aggregator"], "--http.burst", 100_000),
            *("--history.url", f"sqlite:///{self._data}/history.db", "--jam.seconds", JAM_SECONDS),
            *("--recordings.folder", self.recordings),
            *("--mqtt.port", self.broker.port, "--mqtt.reconnect_max", 1.0),
        )

    def control(self, serial: str, command: str, **fields: object) -> None:
        """Send a loopback robot a simulation control command."""
        topic = f"{self.interface}/loopback/NeNa/{serial}/control"
        self.wire.publish(topic, json.dumps({"command": command, **fields}))

    async def order(self, name: str, *stations: str, vehicle: str | None = None, **more: object) -> None:
        """Create an order that takes up cargo at the first station, and sets it down at the second."""
        operations = ("Load cargo", "Unload cargo")
        body: dict[str, Any] = {
            "name": name,
            "destinations": [
                {"locationName": station, "operation": operation}
                for station, operation in zip(stations, operations, strict=False)
            ],
            **more,
        }
        answer = await self.orders.post(
            "/v1/transportOrders", json=body | ({"intendedVehicle": vehicle} if vehicle else {})
        )
        assert answer.is_success, answer.text

    def targets(self) -> dict[str, Any]:
        """Return what Prometheus scrapes."""
        local = "127.0.0.1:{}".format
        return {
            "order_services": [local(self._ports["order-service"])],
            "agents": [local(each) for each in self._metrics_ports.values()],
        }

    @property
    def aggregator_address(self) -> str:
        """Return host and port of the aggregator."""
        return self.aggregator_url.removeprefix("http://")

    def _agent(self, serial: str, journal: Path | None = None) -> str:
        own = self.single_journal if serial == SINGLE else journal
        text = super()._agent(serial, own).replace("state_maximum = 5.0", "state_maximum = 1.0")
        recorded = RECORDED.format(folder=self.folder) if serial == SINGLE else ""
        return f"{text}\n[metrics]\nport = {self._metrics_ports[serial]}\n{recorded}"

    def _program(
        self,
        name: str,
        script: str,
        *arguments: object,
        environment: Mapping[str, str] | None = None,
        **more: Any,
    ) -> Program:
        own = self._environments.get(name.replace("-", "_"))
        chosen = environment if own is None else own
        return super()._program(name, script, *arguments, environment=chosen, **more)


class Watch:
    """What the people of a site learn from its alerts."""

    def __init__(self, prometheus: Prometheus, alertmanager: Alertmanager) -> None:
        self.prometheus = prometheus
        self._receiver = alertmanager.receiver
        self._expected = 0
        """So many notices belong to faults."""

    async def quiet(self) -> None:
        """Wait until no alert fires."""
        await self._until_firing({}, OVER_WITHIN)

    async def finds(
        self, fault: AbstractAsyncContextManager[None], alerts: Mapping[str, int], **labels: str
    ) -> list[dict[str, str]]:
        """Cause a fault, and end it once exactly its alerts fire; return their labels.

        Each must begin once and end once.

        Args:
            fault: begins with the block and ends with it.
            alerts: the number of its alerts by name.
            labels: labels that each of these alerts must have.
        """
        await self.nothing_else()
        start = self._expected
        began = time.monotonic()
        async with fault:
            await self._until_firing(alerts, WITHIN)
            notices = self._receiver.notices[start:]
        self._note({name: max(each.at for each in notices if each.name == name) - began for name in alerts})
        await self.quiet()
        self._expected = len(self._receiver.notices)
        return self._checked(self._receiver.notices[start:], alerts, labels)

    async def nothing_else(self) -> None:
        """Check that nothing has fired but what faults have caused."""
        await self.quiet()
        assert self._receiver.notices[self._expected :] == []

    async def _until_firing(self, alerts: Mapping[str, int], seconds: float) -> None:
        """Wait until exactly these numbers of alerts fire."""

        async def look() -> Counter[str]:
            return self._receiver.firing()

        wanted = Counter(alerts)
        await awaited(
            look, lambda now: now == wanted, seconds=seconds, what=f"firing: {dict(alerts)}", every=LOOK_EVERY
        )

    def _note(self, seconds: Mapping[str, float]) -> None:
        """Append how long each alert took to :data:`FILE`."""
        FILE.parent.mkdir(exist_ok=True)
        with FILE.open("a", encoding="utf-8") as file:
            file.write(json.dumps({name: round(each, 1) for name, each in seconds.items()}) + "\n")

    def _checked(
        self, notices: list[Notice], alerts: Mapping[str, int], labels: Mapping[str, str]
    ) -> list[dict[str, str]]:
        """Check that each alert began once and ended once, and that there were no others."""
        begun: Counter[Labels] = Counter(each.labels for each in notices if each.firing)
        ended: Counter[Labels] = Counter(each.labels for each in notices if not each.firing)
        assert begun == ended
        assert set(begun.values()) == {1}, begun
        found = [dict(each) for each in begun]
        for each in notices:
            assert each.link == f"https://docs.example/runbook/#{each.name.lower()}"
        assert not any("nena_runbook" in each for each in found)
        assert Counter(each["alertname"] for each in found) == Counter(alerts)
        assert all(labels.items() <= each.items() for each in found), (labels, found)
        return found


@asynccontextmanager
async def watched(site: WatchedSite, *, unhurried: str = UNHURRIED) -> AsyncIterator[Watch]:
    """Start a site, and what watches it; all programs respond when the block begins.

    ``unhurried``: the alert that keeps its duration.
    """
    try:
        await site.start()
        with Alertmanager(site.folder) as alertmanager:
            async with Prometheus(
                site.folder,
                site.aggregator_address,
                alertmanager=alertmanager.address,
                unhurried=unhurried,
                **site.targets(),
            ) as prometheus:
                watch = Watch(prometheus, alertmanager)
                all_up = "count(up == 1) == count(up)"
                await eventually(partial(prometheus.query, all_up), all_up)
                yield watch
                await watch.nothing_else()
    finally:
        await site.close()
