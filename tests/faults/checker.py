"""Compares hosts' statuses, the store and robots' reports: nothing lost or done twice."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import psutil
from pydantic import ValidationError

from faults.host import Host
from faults.site import Site
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.mqtt import Inbound
from support.executions import Execution, ended_actions, executions
from support.waiting import awaited, until

ENDED_WITHIN = 240.0
"""Seconds that what was ordered has to come to its end once everything works again."""
TOLD_WITHIN = 60.0
MOST_MB = 300.0
"""Resident memory of a program; what grows without a bound passes it."""
MOST_JOURNAL_KB = 256
"""Of a robot: a journal holds what the robot is at, and not what it was at before."""
PAGE = 500


@dataclass(frozen=True, slots=True)
class Account:
    """What is known of all orders at the end."""

    store: dict[str, TransportOrderStatus]
    told: dict[str, list[TransportOrderStatus]]
    """By MQTT, in the order in which it came."""
    done: list[Execution]
    """Loads that robots have taken up and set down: by their states, and by their logs, which have no holes
    where the broker was away."""


async def settled(site: Site, host: Host) -> Account:
    """Wait until every order has ended, and check that the accounts agree.

    Raises:
        AssertionError: an order is lost, done twice, or reported wrongly.
    """

    async def not_ended() -> dict[str, str]:
        known = await stored(site)
        lost = dict.fromkeys(host.answered - known.keys(), "is not in the store")
        return lost | {name: each.reason for name, each in known.items() if not each.state.final}

    await awaited(
        not_ended,
        lambda found: not found,
        seconds=ENDED_WITHIN,
        what="the end of every order (else: why not)",
    )
    await until(
        lambda: _all_ended(told_in(_statuses(site)), host.answered),
        timeout=TOLD_WITHIN,
        what="the end of every order is told",
    )
    account = await account_of(site)
    assert not host.refused, f"refused: {host.refused}"
    check(account, host.answered)
    _check_programs(site)
    check_journals(site.journals)
    failed = [each for each in account.store.values() if each.state != "FINISHED"]
    unforeseen = {each.name: each.reason for each in failed if each.processing_vehicle not in site.suspects}
    assert len(unforeseen) <= site.may_fail, unforeseen
    silent = [each.name for each in failed if not each.reason]
    assert not silent, f"failed without a reason: {silent}"
    return account


async def account_of(site: Site) -> Account:
    """Return what is known of all orders now."""
    own = {f"{site.interface}/v2/NeNa/{each}/state" for each in site.vehicles}
    states = (each for each in site.wire.history if each.topic in own)
    done = executions(states)
    logged = set().union(*(ended_actions(each.log) for each in site.programs.values()))
    return Account(await stored(site), told_in(_statuses(site)), [*done, *(logged - set(done))])


def check(account: Account, answered: set[str]) -> None:
    """Check that the accounts agree.

    Raises:
        AssertionError: an order is lost, done twice, or reported wrongly.
    """
    assert answered, "nothing was ordered at all"
    lost, strange = answered - account.store.keys(), account.store.keys() - answered
    assert not lost, f"lost: {lost}"
    assert not strange, f"orders that nobody gave: {strange}"
    _check_work(account)
    _check_told(account)


def _check_work(account: Account) -> None:
    """Check that each leg was done once, and all legs of an order by one robot, which has the load."""
    ordered = {f"{name}-{leg}" for name in account.store for leg in range(2)}
    ended_well = [name for name, each in account.store.items() if each.state == "FINISHED"]
    finished = {f"{name}-{leg}" for name in ended_well for leg in range(2)}
    done: dict[str, list[Execution]] = defaultdict(list)
    robots: dict[str, set[str]] = defaultdict(set)
    for each in account.done:
        done[each.drive_order].append(each)
        robots[each.drive_order.rpartition("-")[0]].add(each.robot)
    twice = [each for each in done.values() if len(each) > 1]
    assert not twice, f"done twice: {twice}"
    shared = {name: each for name, each in robots.items() if len(each) > 1}
    assert not shared, f"set down by another robot: {shared}"
    assert done.keys() <= ordered, f"done without an order: {done.keys() - ordered}"
    missing = finished - done.keys()
    assert not missing, f"told as done, and not done: {missing}"


def _check_told(account: Account) -> None:
    for name, order in account.store.items():
        told = account.told.get(name, [])
        assert told, f"{name} was never told of"
        assert told[-1].state == order.state, f"{name} was last told as {told[-1].state}"
        ends = {each.state for each in told if each.state.final}
        assert ends == {order.state}, f"{name} was told to have ended in several ways: {ends}"


def _check_programs(site: Site) -> None:
    for name, program in site.programs.items():
        assert program.process.poll() is None, f"{name} has ended:\n{program.log[-3000:]}"
        assert "Traceback" not in program.log, (
            f"{name}: {program.log[program.log.index('Traceback') :][:3000]}"
        )
        megabytes = psutil.Process(program.process.pid).memory_info().rss / 1e6
        assert megabytes < MOST_MB, f"{name} has {megabytes:.0f} MB"


def check_journals(files: Iterable[Path]) -> None:
    """Check that none has grown."""
    sizes = {file.name: file.stat().st_size for file in files}
    assert sizes, "no robot has a journal"
    large = {name: size for name, size in sizes.items() if size > MOST_JOURNAL_KB * 1024}
    assert not large, f"journals have grown: {large}"


async def stored(site: Site) -> dict[str, TransportOrderStatus]:
    """Return all orders, page by page."""
    found: dict[str, TransportOrderStatus] = {}
    after: dict[str, str] = {}
    while True:
        answer = await site.orders.get("/v1/transportOrders", params={"limit": PAGE, **after})
        page = answer.raise_for_status().json()
        orders = [TransportOrderStatus.model_validate(each) for each in page["transportOrders"]]
        found |= {each.name: each for each in orders}
        if page["next"] is None:
            return found
        after = {"after": page["next"]}


def _all_ended(told: Mapping[str, list[TransportOrderStatus]], names: Iterable[str]) -> bool:
    return all(told.get(name) and told[name][-1].state.final for name in names)


def _statuses(site: Site) -> list[Inbound]:
    return site.wire.received("nena/v1/transportOrders/+/status")


def told_in(statuses: Iterable[Inbound]) -> dict[str, list[TransportOrderStatus]]:
    """Return the statuses that hosts received of each order."""
    told: dict[str, list[TransportOrderStatus]] = defaultdict(list)
    for message in statuses:
        if message.payload:
            with suppress(ValidationError):  # somebody else said it: a hostile message
                status = TransportOrderStatus.model_validate_json(message.payload)
                told[status.name].append(status)
    return told
