"""Compares what hosts were told, what the store says and what robots did: nothing lost or done twice."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass

import psutil
from pydantic import ValidationError

from faults.host import Host
from faults.site import Site
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.state import State
from nena_shared.vda5050.v2_1 import CODEC
from support.waiting import awaited, until

WORK = ("pick", "drop")
ENDED_WITHIN = 240.0
"""Seconds that what was ordered has to come to its end once everything works again."""
TOLD_WITHIN = 60.0
MOST_MB = 300.0
"""Resident memory of a program; what grows without a bound passes it."""
PAGE = 500


@dataclass(frozen=True, slots=True)
class Account:
    """What is known of all orders at the end."""

    store: dict[str, TransportOrderStatus]
    told: dict[str, list[TransportOrderStatus]]
    """By MQTT, in the order in which it came."""
    done: Counter[str]
    """How many loads were taken up and set down for each drive order."""


async def settled(site: Site, host: Host) -> Account:
    """Wait until every order is at its end, and see that the accounts agree.

    Raises:
        AssertionError: an order is lost, done twice, or told otherwise than it was.

    """

    async def not_ended() -> dict[str, str]:
        stored = await _stored(site)
        lost = dict.fromkeys(host.answered - stored.keys(), "is not in the store")
        return lost | {name: each.reason for name, each in stored.items() if not each.state.final}

    await awaited(
        not_ended,
        lambda found: not found,
        seconds=ENDED_WITHIN,
        what="the end of every order (else: why not)",
    )
    await until(
        lambda: _all_ended(_told(site), host.answered),
        timeout=TOLD_WITHIN,
        what="the end of every order is told",
    )
    account = await account_of(site)
    assert host.refused == []
    assert host.answered, "nothing was ordered at all"
    assert account.store.keys() == host.answered, "orders that nobody gave, or that are lost"
    _check_work(account, complete=not site.wire_broke)
    _check_told(account)
    _check_programs(site)
    failed = [each for each in account.store.values() if each.state != "FINISHED"]
    unforeseen = {each.name: each.reason for each in failed if each.processing_vehicle not in site.suspects}
    assert len(unforeseen) <= site.may_fail, unforeseen
    assert all(each.reason for each in failed)
    return account


async def account_of(site: Site) -> Account:
    """Give what is known of all orders by now."""
    return Account(await _stored(site), _told(site), _done(site))


def _check_work(account: Account, *, complete: bool) -> None:
    """See that each leg was worked off once; where our own line broke, we may not have seen all of it."""
    ordered = {f"{name}-{leg}" for name in account.store for leg in range(2)}
    ended_well = [name for name, each in account.store.items() if each.state == "FINISHED"]
    finished = {f"{name}-{leg}" for name in ended_well for leg in range(2)}
    assert {order: times for order, times in account.done.items() if times > 1} == {}, "done twice"
    assert account.done.keys() <= ordered, "done without an order"
    if complete:
        assert finished <= account.done.keys(), "told as done, and not done"


def _check_told(account: Account) -> None:
    for name, order in account.store.items():
        told = account.told[name]
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


async def _stored(site: Site) -> dict[str, TransportOrderStatus]:
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


def _told(site: Site) -> dict[str, list[TransportOrderStatus]]:
    told: dict[str, list[TransportOrderStatus]] = defaultdict(list)
    for message in site.wire.received("nena/v1/transportOrders/+/status"):
        if message.payload:
            with suppress(ValidationError):  # somebody else said it: a hostile message
                status = TransportOrderStatus.model_validate_json(message.payload)
                told[status.name].append(status)
    return told


def drive_order_of(order_id: str) -> str:
    """Give the drive order that a VDA 5050 order is for, whichever try of it that is."""
    return order_id.partition("~")[0]


def _done(site: Site) -> Counter[str]:
    finished: set[tuple[str, str]] = set()
    own = {f"{site.interface}/v2/NeNa/{each}/state" for each in site.vehicles}
    for message in (each for each in site.wire.history if each.topic in own):
        with suppress(MalformedMessageError):  # somebody else said it: a hostile message
            state = CODEC.decode(State, message.payload)
            finished |= {
                (drive_order_of(state.order_id), action.action_id)
                for action in state.action_states
                if action.action_status == "FINISHED" and action.action_type in WORK
            }
    return Counter(order for order, _ in finished)
