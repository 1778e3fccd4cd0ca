"""A site with two order services on one PostgreSQL, and robots of three kinds."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import AsyncIterator, Iterator
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import httpx

from faults import history as judge
from faults.checker import stored, told_in
from faults.hall import MAP_ID, start_of
from faults.history import Event, History, Kind
from faults.host import Host
from faults.outside_robots import Standing, library_robot, standard_robot
from faults.site import Layout, Site
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_1 import CODEC
from support.broker import free_port
from support.executions import ended_actions, executions
from support.pausing import time_passes
from support.programs import Program
from support.waiting import PATIENCE, awaited

NAMES = ("one", "two")
LOOPBACK = 2
ANSWERED_WITHIN = 2.0
"""Seconds after which the other order service is asked."""
LOOK_EVERY = 0.25
"""Seconds between two questions for the role of an order service: more often is a load of its own."""
ROLE_WITHIN = 5 * PATIENCE
LONGEST_SILENCE = 1.0
"""Seconds between two states of a robot that drives; where there are more, states are missing."""
ENDED_WITHIN = 240.0
ECHO = 0.3
"""Seconds after which the plain robot reports that it has an order."""


class _Either(httpx.AsyncBaseTransport):
    """Requests the order service that answered last.

    If it is on standby or does not answer, the other one.
    """

    def __init__(self, ports: list[int]) -> None:
        self._ports = ports
        self._inner = httpx.AsyncHTTPTransport(limits=httpx.Limits(max_keepalive_connections=0))

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        """Send a request to each in turn."""
        timeouts = dict.fromkeys(("connect", "read", "write", "pool"), ANSWERED_WITHIN)
        request.extensions["timeout"] = timeouts
        failure: Exception = httpx.ConnectError("nobody was asked")
        for port in list(self._ports):
            request.url = request.url.copy_with(port=port)
            try:
                response = await self._inner.handle_async_request(request)
            except httpx.TransportError as error:
                failure = error
            else:
                if response.status_code != httpx.codes.SERVICE_UNAVAILABLE:
                    self._ports.sort(key=lambda each: each != port)
                    return response
                failure = httpx.ConnectError("stands by")
                await response.aclose()
        raise failure


class PairSite(Site):
    """Robots: ``loop-...`` are NeNa's, ``single-1`` is a library's, ``single-2`` from the standard alone."""

    def __init__(self, folder: Path, store_url: str, *, library: bool = True, **layout: Any) -> None:
        """Prepare it; ``library``: whether it has the robot on the library."""
        super().__init__(folder, Layout(loopback=LOOPBACK, singles=2, store_url=store_url, **layout))
        self._stores = store_url
        self._library = library
        self._own_ports = {name: free_port() for name in NAMES}
        self.orders = httpx.AsyncClient(
            base_url="http://127.0.0.1", transport=_Either(list(self._own_ports.values())), timeout=60
        )
        self._roles = httpx.AsyncClient(timeout=ANSWERED_WITHIN)
        self.history = History()
        self.clocks_jumped = False
        """Whether the times in states of NeNa's robots tell nothing."""
        self._robots = AsyncExitStack()

    async def start(self) -> None:
        """Start everything, and wait until every robot can accept an order."""
        for name in NAMES:
            self.start_service(name)
        self.start_loopback()
        x, y = start_of(LOOPBACK)
        if self._library:
            there = Standing("single-1", MAP_ID, x, y)
            await self._robots.enter_async_context(library_robot(self.broker, there, self.history))
        x, y = start_of(LOOPBACK + 1)
        there = Standing("single-2", MAP_ID, x, y, echo=ECHO)
        await self._robots.enter_async_context(
            standard_robot(self.broker, self.interface, there, self.history)
        )
        await self.robots_are("ONLINE", *(("single-1",) if self._library else ()), "single-2")

    def start_service(self, name: str) -> Program:
        """Start one of the order services."""
        return self._program(
            f"order-service-{name}",
            "nena-order-service",
            *("--plant", self.plant, "--store.url", self._stores),
            *("--http.port", self._own_ports[name], "--http.burst", 100_000),
            *("--mqtt.port", self.port_for(name), "--mqtt.reconnect_max", 1.0),
        )

    async def role_of(self, name: str) -> str:
        """Return the role that an order service reports; empty if it does not answer."""
        try:
            told = (await self._roles.get(f"http://127.0.0.1:{self._own_ports[name]}/readyz")).json()
        except (httpx.HTTPError, ValueError):
            return ""
        return str(told.get("role", ""))

    @staticmethod
    def other(name: str) -> str:
        """Return the name of the other order service."""
        return NAMES[1 - NAMES.index(name)]

    async def leader(self) -> str:
        """Wait until an order service is the active one, and return its name."""

        async def look() -> str:
            roles = {name: await self.role_of(name) for name in NAMES}
            return next((name for name, role in roles.items() if role == "active"), "")

        return await awaited(
            look, bool, seconds=ROLE_WITHIN, what="an active order service", every=LOOK_EVERY
        )

    async def stands_by(self, name: str) -> None:
        """Wait until an order service is on standby; start it again if it has exited."""

        async def look() -> str:
            if self.programs[f"order-service-{name}"].process.poll() is not None:
                self.start_service(name)
            return await self.role_of(name)

        await awaited(
            look,
            lambda role: role == "standby",
            seconds=ROLE_WITHIN,
            what=f"{name} stands by",
            every=LOOK_EVERY,
        )

    async def start_again_what_is_stuck(self) -> None:
        """Kill and restart each order service that is neither active nor on standby."""
        for name in NAMES:
            if await self.role_of(name) not in ("active", "standby"):
                self.programs[f"order-service-{name}"].kill()
                self.start_service(name)

    @asynccontextmanager
    async def paused(self, name: str) -> AsyncIterator[None]:
        """Suspend an order service until the block ends."""
        process = self.programs[f"order-service-{name}"].process
        process.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            process.send_signal(signal.SIGCONT)

    async def close(self) -> None:
        """End everything."""
        await self._robots.aclose()
        await self._roles.aclose()
        await super().close()

    def complete_history(self) -> History:
        """Return the history of all robots; that of NeNa's own ones is read from their states and log.

        What the states do not show, because the broker was away, the log does.
        """
        found = list(self.history.events)
        logged = ended_actions(self.programs["loopback"].log)
        for serial in self.serials:
            states = self.wire.received(f"{self.interface}/v2/NeNa/{serial}/state")
            if not self.clocks_jumped:
                found += places(serial, [CODEC.decode(State, each.payload) for each in states])
            seen = executions(states)
            more = {each for each in logged if each.robot == serial} - set(seen)
            done = [*seen, *more]
            found += (Event(0.0, serial, Kind.ENDED, each.action_id, each.drive_order) for each in done)
        return History(found)


def places(robot: str, states: list[State]) -> Iterator[Event]:
    """Yield where a robot was by its states: on its last node, until it reports the next one.

    If states are missing, it is known to have been there as long as it reported so.
    """
    here, last = "", 0.0
    for state in sorted(states, key=lambda each: each.timestamp):
        at = state.timestamp.timestamp()
        if state.last_node_id != here:
            if here:
                yield Event(at if at - last < LONGEST_SILENCE else last, robot, Kind.LEFT, here)
            yield Event(at, robot, Kind.ENTERED, state.last_node_id)
            here = state.last_node_id
        last = at


async def judged(site: PairSite, host: Host) -> list[str]:
    """Wait until every order is at its end, and return what must not have been."""
    store = await _ended(site)
    history = site.complete_history()
    statuses = site.wire.received("nena/v1/transportOrders/+/status")
    found = [
        *judge.lost(host.answered, store),
        *judge.done_wrongly(history, store),
        *judge.begun_again(history),
        *judge.shared_places(history),
        *judge.told_back(statuses),
        *(f"a host was refused: {each}" for each in host.refused),
    ]
    untold = host.answered - told_in(statuses).keys()
    return [*found, *(f"{each} was never told of" for each in sorted(untold))]


async def _ended(site: PairSite) -> dict[str, TransportOrderStatus]:
    """Return all orders, once each has ended or the patience has."""
    store: dict[str, TransportOrderStatus] = {}
    try:
        async with asyncio.timeout(ENDED_WITHIN):
            while not store or not all(each.state.final for each in store.values()):
                with suppress(httpx.HTTPError, KeyError, ValueError):
                    store = await stored(site)
                await time_passes(0.5)
    except TimeoutError:
        pass
    return store
