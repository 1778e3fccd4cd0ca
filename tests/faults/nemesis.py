"""Faults drawn by a seed, one on top of the other, while robots of three kinds work; their histories judge.

``python -m faults.nemesis --seeds 200``; the exit status is 1 if an order was done twice or lost, two robots
were in one place, or a status went back. The same seed draws the same faults.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import AsyncExitStack, ExitStack, asynccontextmanager
from dataclasses import dataclass
from datetime import timedelta
from enum import StrEnum
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from random import Random

import httpx
import pytest

from faults.checker import stored
from faults.host import Host
from faults.pair import LOOK_EVERY, NAMES, PairSite, judged
from nena_shared.fleet_api.transport_order import TransportOrderState
from support.broker import free_port
from support.mqtt_line import Conduct, MqttLine, Way, mqtt_line
from support.pausing import time_passes
from support.postgres import Postgres
from support.programs import Program
from support.shifted_clock import ShiftedClock
from support.small_disk import SmallDisk, small_disk
from support.waiting import PATIENCE, awaited

ROUNDS = 3
AT_ONCE = 5
BETWEEN = 2.0
"""Seconds from the end of the faults of a round to the next ones."""
SHORTEST, LONGEST = 0.5, 6.0
"""Seconds that faults last."""
DISK_MB = 4
RIVAL_ENDS_WITHIN = PATIENCE
JUMPS = (-18_000, -40, 90, 10_800)
"""Seconds that clocks jump."""
DRIFTS = (-0.2, -0.02, 0.02, 0.2)
"""Seconds that clocks gain in each second, a thousand times as much as bad ones do."""


class Kind(StrEnum):
    """What may go wrong."""

    LEADER_KILLED = "leader killed"
    LEADER_PAUSED = "leader paused"
    STANDBY_KILLED = "standby killed"
    ROBOTS_KILLED = "robots killed"
    ROBOTS_PAUSED = "robots paused"
    CUT_ONE_WAY = "cut one way"
    SLOW = "slow"
    REORDERED = "messages in another order"
    REPEATED = "messages twice"
    NOTHING_DELIVERED = "broker accepts and delivers nothing"
    BROKER_PAUSED = "broker paused"
    BROKER_RESTARTED = "broker restarted"
    """With or without what it had retained, as the seed says."""
    STORE_GONE = "store gone"
    STORE_PAUSED = "store paused"
    CLOCKS_OF_SERVICES = "clocks of services jump"
    CLOCKS_OF_ROBOTS = "clocks of robots jump"
    SERVICES_DRIFT = "clocks of services drift"
    ROBOTS_DRIFT = "clocks of robots drift"
    DISK_FULL = "robots' disk full"
    TWO_LEADERS = "two leaders"


PART = {
    Kind.LEADER_KILLED: "services",
    Kind.LEADER_PAUSED: "services",
    Kind.STANDBY_KILLED: "services",
    Kind.ROBOTS_KILLED: "robots",
    Kind.ROBOTS_PAUSED: "robots",
    Kind.DISK_FULL: "robots",
    Kind.BROKER_PAUSED: "broker",
    Kind.BROKER_RESTARTED: "broker",
    Kind.STORE_GONE: "store",
    Kind.STORE_PAUSED: "store",
    Kind.CLOCKS_OF_SERVICES: "clocks",
    Kind.CLOCKS_OF_ROBOTS: "clocks",
    Kind.SERVICES_DRIFT: "clocks",
    Kind.ROBOTS_DRIFT: "clocks",
}
"""Two faults of one part do not come together; those that are not here are of lines."""
LINES = (*NAMES, "loopback")
ON_LINES = {Kind.CUT_ONE_WAY, Kind.SLOW, Kind.REORDERED, Kind.REPEATED, Kind.NOTHING_DELIVERED}
SERVICES_CLOCK = {Kind.CLOCKS_OF_SERVICES, Kind.SERVICES_DRIFT}
ROBOTS_CLOCK = {Kind.CLOCKS_OF_ROBOTS, Kind.ROBOTS_DRIFT}


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault, and where it strikes."""

    kind: Kind
    line: str = ""
    way: Way = Way.TO_BROKER
    strength: float = 0.0
    """Seconds of a delay or jump, or a share of the messages or of the time."""

    def __str__(self) -> str:
        where = f" at {self.line}" if self.line else ""
        way = f" {self.way}" if self.kind is Kind.CUT_ONE_WAY else ""
        return f"{self.kind}{where}{way}" + (f" ({self.strength:g})" if self.strength else "")


@dataclass(frozen=True, slots=True)
class Round:
    """Faults that come at the same time."""

    faults: tuple[Fault, ...]
    seconds: float

    def __str__(self) -> str:
        return f"{' and '.join(map(str, self.faults))}, {self.seconds:.1f} s"


@dataclass(frozen=True, slots=True)
class Plan:
    """All faults of a site."""

    seed: int
    persistence: bool
    """Whether the broker keeps retained messages over a restart."""
    rounds: tuple[Round, ...]

    @classmethod
    def of(cls, seed: int, rounds: int = ROUNDS) -> Plan:
        """Draw the faults of a seed."""
        chance = Random(seed)
        persistence = chance.random() < 0.5
        return cls(seed, persistence, tuple(_round(chance) for _ in range(rounds)))

    @property
    def kinds(self) -> set[Kind]:
        """All kinds of faults in it."""
        return {fault.kind for each in self.rounds for fault in each.faults}


def _round(chance: Random) -> Round:
    faults = [_fault(chance, chance.choice(list(Kind)))]
    if faults[0].kind is not Kind.TWO_LEADERS and chance.random() < 0.5:
        own = _part(faults[0])
        others = [each for each in Kind if PART.get(each) != own and each is not Kind.TWO_LEADERS]
        faults.append(_fault(chance, chance.choice(others)))
        if _part(faults[1]) == own:
            faults.pop()
    return Round(tuple(faults), round(chance.uniform(SHORTEST, LONGEST), 1))


def _part(fault: Fault) -> str:
    return PART.get(fault.kind) or fault.line


STRENGTHS: Mapping[Kind, Sequence[float]] = {
    Kind.SLOW: (0.05, 0.3, 1.0),
    Kind.REORDERED: (0.1, 0.5),
    Kind.REPEATED: (0.1, 0.5),
    Kind.CLOCKS_OF_SERVICES: JUMPS,
    Kind.CLOCKS_OF_ROBOTS: JUMPS,
    Kind.SERVICES_DRIFT: DRIFTS,
    Kind.ROBOTS_DRIFT: DRIFTS,
}


def _fault(chance: Random, kind: Kind) -> Fault:
    line, way = chance.choice(LINES), chance.choice(list(Way))
    return Fault(
        kind,
        line if kind in ON_LINES else "",
        way if kind is Kind.CUT_ONE_WAY else Way.TO_BROKER,
        chance.choice(STRENGTHS[kind]) if kind in STRENGTHS else 0.0,
    )


class NemesisSite(PairSite):
    """A pair of order services, and lines between them, the loopback robots and the broker."""

    def __init__(self, folder: Path, postgres: Postgres, plan: Plan) -> None:
        self.skipped: dict[Kind, str] = {}
        """Faults that this machine cannot have, and why."""
        self._means = ExitStack()
        self._postgres = postgres
        self.lines: dict[str, MqttLine] = {}
        self._services_clock = self._clock(folder / "services-clock", SERVICES_CLOCK & plan.kinds)
        self._robots_clock = self._clock(folder / "robots-clock", ROBOTS_CLOCK & plan.kinds)
        self._disk = self._small_disk(folder) if Kind.DISK_FULL in plan.kinds else None
        library = find_spec("vda5050") is not None and Kind.BROKER_RESTARTED not in plan.kinds
        super().__init__(
            folder,
            postgres.url,
            library=library,  # it does not come back to a broker that was away
            persistence=plan.persistence,
            data=self._disk.folder if self._disk else None,
            services_in=self._services_clock.environment if self._services_clock else {},
            robots_in=self._robots_clock.environment if self._robots_clock else {},
        )
        self.clocks_jumped = bool(ROBOTS_CLOCK & plan.kinds)
        self.lines = {
            name: self.stack.enter_context(mqtt_line(self.broker, seed=plan.seed)) for name in LINES
        }

    def port_for(self, part: str) -> int:
        """Return the port of a part's line."""
        return self.lines[part].port

    async def close(self) -> None:
        """End everything."""
        await super().close()
        self._means.close()

    @asynccontextmanager
    async def under(self, fault: Fault) -> AsyncIterator[None]:
        """Apply a fault until the block ends."""
        if fault.kind in self.skipped:
            yield
            return
        async with AsyncExitStack() as stack:
            match fault.kind:
                case Kind.LEADER_KILLED | Kind.STANDBY_KILLED | Kind.LEADER_PAUSED:
                    leader = await self.leader()
                    name = self.other(leader) if fault.kind is Kind.STANDBY_KILLED else leader
                    if fault.kind is Kind.LEADER_PAUSED:
                        await stack.enter_async_context(self.paused(name))
                    else:
                        self.programs[f"order-service-{name}"].kill()
                        stack.callback(self.start_service, name)
                case Kind.ROBOTS_KILLED:
                    self.programs["loopback"].kill()
                    stack.callback(self.start_loopback)
                case Kind.TWO_LEADERS:
                    await self._rival()
                case _:
                    stack.callback(
                        self._begin_on_line(fault) if fault.line else self._begin(fault.kind, fault.strength)
                    )
            yield

    def _begin_on_line(self, fault: Fault) -> Callable[[], None]:
        """Start a fault of a line; return a function that ends it."""
        changed = {
            Kind.CUT_ONE_WAY: ("held", {fault.way}),
            Kind.SLOW: ("delay", fault.strength),
            Kind.REORDERED: ("swapped", fault.strength),
            Kind.REPEATED: ("repeated", fault.strength),
            Kind.NOTHING_DELIVERED: ("swallowed", True),
        }
        name, value = changed[fault.kind]
        conduct = self.lines[fault.line].conduct
        setattr(conduct, name, value)
        return partial(setattr, conduct, name, getattr(Conduct(), name))

    def _begin(self, kind: Kind, strength: float) -> Callable[[], object]:
        """Start a fault of programs, clocks or disks; return a function that ends it."""
        begin: Callable[[], object]
        undo: Callable[[], object]
        if kind in SERVICES_CLOCK | ROBOTS_CLOCK:
            clock = self._services_clock if kind in SERVICES_CLOCK else self._robots_clock
            assert clock is not None
            drifts = kind in (Kind.SERVICES_DRIFT, Kind.ROBOTS_DRIFT)
            begin = (
                partial(clock.drift, strength)
                if drifts
                else partial(clock.jump_to, timedelta(seconds=strength))
            )
            undo = partial(clock.jump_to, timedelta())
        elif kind is Kind.STORE_PAUSED:
            frozen = self._postgres.frozen()
            begin, undo = frozen.__enter__, partial(frozen.__exit__, None, None, None)
        elif kind is Kind.DISK_FULL:
            assert self._disk is not None
            begin, undo = self._disk.fill, self._disk.clear
        elif kind is Kind.ROBOTS_PAUSED:
            signalled = self.programs["loopback"].process.send_signal
            begin, undo = partial(signalled, signal.SIGSTOP), partial(signalled, signal.SIGCONT)
        else:
            begin, undo = {
                Kind.BROKER_PAUSED: (self.broker.freeze, self.broker.thaw),
                Kind.BROKER_RESTARTED: (self.broker.kill, self.broker.start),
                Kind.STORE_GONE: (self._postgres.stop, self._postgres.start),
            }[kind]
        begin()
        return undo

    async def _rival(self) -> None:
        """Start an order service with a separate store on this fleet: it must exit and accept nothing.

        Raises:
            AssertionError: it keeps running, or accepted an order.
        """
        await self.leader()
        port = free_port()
        log = self.folder / "rival.log"
        rival = self.stack.enter_context(
            Program(
                "nena-order-service",
                *("--plant", self.plant, "--store.url", f"sqlite:///{self.folder}/rival.db"),
                *("--http.port", port, "--mqtt.port", self.broker.port),
                log=log,
            )
        )
        order = {"destinations": [{"locationName": "Station 1", "operation": "Load cargo"}]}
        taken = []

        async def ended() -> bool:
            try:
                answer = await self._roles.post(f"http://127.0.0.1:{port}/v1/transportOrders", json=order)
            except httpx.HTTPError:
                return rival.process.poll() is not None
            taken.extend([answer.text] if answer.is_success else [])
            return rival.process.poll() is not None

        try:
            await awaited(
                ended, bool, seconds=RIVAL_ENDS_WITHIN, what="the rival has ended", every=LOOK_EVERY
            )
        finally:
            rival.kill()
        assert not taken, f"the rival took {taken}"

    def _clock(self, folder: Path, kinds: set[Kind]) -> ShiftedClock | None:
        """Return a clock for faults of these kinds; None if there are none, or no clock can be made here."""
        if not kinds:
            return None
        folder.mkdir()
        try:
            return ShiftedClock(folder)
        except pytest.skip.Exception as why:
            self.skipped |= dict.fromkeys(kinds, str(why))
            return None

    def _small_disk(self, folder: Path) -> SmallDisk | None:
        try:
            return self._means.enter_context(small_disk(folder / "disk", DISK_MB))
        except pytest.skip.Exception as why:
            self.skipped[Kind.DISK_FULL] = str(why)
            return None


@dataclass(frozen=True, slots=True)
class Result:
    """What came of a seed."""

    plan: Plan
    orders: int
    finished: int
    seconds: float
    findings: list[str]
    skipped: dict[Kind, str]

    def __str__(self) -> str:
        rounds = "; ".join(map(str, self.plan.rounds))
        kept = "kept" if self.plan.persistence else "lost"
        skipped = "".join(f"\n  skipped: {kind}: {why}" for kind, why in self.skipped.items())
        found = "".join(f"\n  FOUND: {each}" for each in self.findings)
        return (
            f"seed {self.plan.seed}: {self.finished} of {self.orders} orders finished, {self.seconds:.0f} s; "
            f"retained messages {kept}; {rounds}{skipped}{found}"
        )


async def run(plan: Plan, folder: Path, postgres: Postgres) -> Result:
    """Run a site under the faults of a plan, and judge it."""
    begun = time.monotonic()
    site = NemesisSite(folder, postgres, plan)
    findings: list[str] = []
    try:
        await site.start()
        host = Host(site, at_once=AT_ONCE, seed=plan.seed)
        ordering = asyncio.create_task(host.run(), name="host")
        for each in plan.rounds:
            await time_passes(BETWEEN)
            try:
                async with AsyncExitStack() as stack:
                    for fault in each.faults:
                        await stack.enter_async_context(site.under(fault))
                    await time_passes(each.seconds)
            except AssertionError as error:
                findings.append(f"{each}: {error}")
        host.stop()
        await asyncio.wait_for(ordering, 2 * PATIENCE)
        for name in NAMES:
            if site.programs[f"order-service-{name}"].process.poll() is not None:
                site.start_service(name)  # one that was replaced has ended
        findings += await judged(site, host)
        states = [each.state for each in (await stored(site)).values()]
        done = states.count(TransportOrderState.FINISHED)
        return Result(plan, len(states), done, time.monotonic() - begun, findings, site.skipped)
    finally:
        await site.close()


def main() -> int:
    """Run the seeds and report."""
    parser = argparse.ArgumentParser(description="Let faults that a seed draws strike a site.")
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    wanted = parser.parse_args()
    postgres = Postgres()
    bad = []
    try:
        for seed in range(wanted.first, wanted.first + wanted.seeds):
            folder = Path(tempfile.mkdtemp(prefix=f"nena-nemesis-{seed}-"))  # kept if something is found
            postgres.empty()
            plan = Plan.of(seed, wanted.rounds)
            try:
                result = asyncio.run(run(plan, folder, postgres))
            except (AssertionError, TimeoutError) as error:
                result = Result(plan, 0, 0, 0.0, [f"the run ended: {error!r}"], {})
            print(result, f"load {os.getloadavg()[0]:.0f}", flush=True)  # noqa: T201 - a person waits for hours
            if result.findings:
                bad.append(seed)
                print(f"  logs: {folder}", flush=True)  # noqa: T201
            else:
                shutil.rmtree(folder)
    finally:
        postgres.close()
    print(f"{wanted.seeds - len(bad)} of {wanted.seeds} seeds without a finding; {bad}")  # noqa: T201
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
