"""The judge of histories, and a site of two order services whose active one hangs again and again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from faults.extent import WHOLE
from faults.history import (
    Event,
    History,
    Kind,
    begun_again,
    done_wrongly,
    lost,
    shared_places,
    told_back,
)
from faults.pauses import run, steps
from nena_shared.fleet_api.epoch import with_epoch
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.mqtt import Inbound
from support.fleet_examples import order_status
from support.postgres import Postgres

FINISHED, FAILED = TransportOrderState.FINISHED, TransportOrderState.FAILED


def at(second: float, robot: str, kind: Kind, what: str, order: str = "") -> Event:
    return Event(second, robot, kind, what, order)


def work(*orders: str) -> History:
    return History([at(0, "r", Kind.ENDED, f"a{n}", order) for n, order in enumerate(orders)])


def store(*states: TransportOrderState, **more: Any) -> dict[str, Any]:
    return {f"T-{n}": order_status(name=f"T-{n}", state=state, **more) for n, state in enumerate(states)}


@pytest.mark.parametrize(
    ("history", "state", "said"),
    [
        (work("T-0-0", "T-0-1", "T-0-1~2"), FINISHED, "T-0-1 was done 2 times"),
        (work("T-0-0"), FINISHED, "T-0-1 was told as done, and no robot has done it"),
        (work("T-0-0", "T-0-1", "T-9-0"), FINISHED, "T-9-0 was done without an order"),
    ],
)
def test_wrong_executions_are_reported(history: History, state: TransportOrderState, said: str) -> None:
    (found,) = done_wrongly(history, store(state))
    assert said in found


def test_an_action_started_twice_is_detected() -> None:
    once = at(0, "r", Kind.BEGUN, "a", "T-0-0")
    assert begun_again(History([once, at(1, "r", Kind.BEGUN, "a", "T-0-0~2")])) == []
    assert begun_again(History([once, once])) == ["r began a of T-0-0 2 times"]


def test_two_robots_in_one_place_are_detected() -> None:
    come, go = at(1, "r", Kind.ENTERED, "P"), at(2, "r", Kind.LEFT, "P")
    assert shared_places(History([come, go, at(3, "s", Kind.ENTERED, "P")])) == []
    (found,) = shared_places(History([come, at(1.5, "s", Kind.ENTERED, "P"), go]))
    assert found == "s came to P 0.500 s after r, which is still there"


def test_orders_without_an_end_or_a_reason_are_detected() -> None:
    assert lost({"T-0"}, store(FINISHED, reason="")) == []
    assert lost({"T-1"}, store(FINISHED, reason="")) == ["T-1 was answered, and is not in the store"]
    assert lost({"T-0"}, store(FAILED, reason="")) == ["T-0 is FAILED without a reason"]
    assert lost({"T-0"}, store(TransportOrderState.ACTIVE, reason="r")) == ["T-0 has no end: r"]


def published(state: TransportOrderState, version: int, epoch: int) -> Inbound:
    status = order_status(name="T-0", state=state, version=version)
    body = status.model_dump_json(by_alias=True).encode()
    return Inbound("nena/v1/transportOrders/T-0/status", with_epoch(body, epoch), retained=False)


def test_statuses_that_go_back_are_detected() -> None:
    active = TransportOrderState.ACTIVE
    good = [published(active, 1, 1), published(FINISHED, 2, 1), published(FINISHED, 2, 2)]
    assert told_back(good) == []
    for worse in (published(FINISHED, 2, 1), published(FINISHED, 1, 2), published(FAILED, 3, 2)):
        assert len(told_back([*good, worse])) == 1


@pytest.mark.long  # test_frozen_leader.py shows one pause
@pytest.mark.e2e
@pytest.mark.broker
@pytest.mark.timeout(1200)
async def test_a_hanging_leader_does_no_harm(tmp_path: Path, own_postgres: Postgres) -> None:
    """As `python -m faults.pauses` does 50 times; here one pause is borne, and two end in a takeover."""
    result = await run(steps(10) if WHOLE else [1.0, 6.0, 9.0], tmp_path, own_postgres.url)

    assert result.findings == []
    assert result.finished == result.orders > 0
    assert result.takeovers > 0
