"""Actions that a robot of VDA 5050 3.0 tries again, or does not."""

from __future__ import annotations

import pytest

from nena_order_service.engine.engine import Engine
from nena_order_service.fleet.failures import FailureKind
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.plant import Link, Location, LocationType, PlantModel, Vehicle
from nena_shared.vda5050.action import ActionStatus
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, make_engine, status_of

pytestmark = pytest.mark.clause("6.2.3/retryAsked")

S = TransportOrderState

PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("AB")),
    paths=(path("A B"),),
    vehicles=(Vehicle(name="V1"),),
    location_types=(LocationType(name="T", allowed_operations=("Wash",)),),
    locations=(Location(name="L", type="T", links=(Link(point="B"),)),),
)


async def failing(*steps: dict[str, object]) -> tuple[Engine, ScriptedFleet]:
    """Return a robot that waits with a failed action for its answer."""
    fleet = ScriptedFleet({"V1": "A"})
    engine = await make_engine(PLANT, MemoryStore(), fleet)
    engine.create(request("L:Wash", onFailure=steps), "T")
    fleet.operate("V1")
    fleet.wait_for_retry("V1")
    return engine, fleet


def answers(fleet: ScriptedFleet) -> list[tuple[str, str]]:
    retries = [each for each in fleet.instants if each.action_type in ("retry", "skipRetry")]
    return [(each.action_type, str(each.parameter("actionId"))) for each in retries]


async def test_an_action_is_retried_by_the_robot() -> None:
    engine, fleet = await failing({"do": "RETRY", "times": 2})
    action = fleet.sent[0][1].actions[0]
    assert action.retriable
    assert answers(fleet) == [("retry", action.action_id)]
    fleet.answer_instant("V1", ActionStatus.FINISHED)
    fleet.finish("V1")

    assert (status_of(engine).state, len(fleet.sent)) == (S.FINISHED, 1)
    assert [entry.event_code for entry in status_of(engine).history].count("nena:retried") == 1


async def test_an_action_without_retries_left_has_failed() -> None:
    engine, fleet = await failing({"do": "RETRY"}, {"do": "SKIP"})
    fleet.answer_instant("V1", ActionStatus.FINISHED)
    fleet.wait_for_retry("V1")
    assert [kind for kind, _ in answers(fleet)] == ["retry", "skipRetry"]
    fleet.fail("V1", "the action has failed", FailureKind.ACTION)

    assert status_of(engine).state is S.FINISHED
    assert status_of(engine).reason.endswith("operations left out: 1")


async def test_a_retry_with_a_delay_sends_a_new_vda_order() -> None:
    engine, fleet = await failing({"do": "RETRY", "after": 10})
    assert [kind for kind, _ in answers(fleet)] == ["skipRetry"]
    fleet.fail("V1", "the action has failed", FailureKind.ACTION, at="B")
    engine.clock.advance(10)  # type: ignore[attr-defined] # the clock of make_engine
    engine.run_checks()

    assert fleet.sent[-1][1].order_id == "T-0~1"


async def test_a_robot_that_rejects_the_retry_answer_is_sent_cancel_order() -> None:
    engine, fleet = await failing({"do": "RETRY"}, {"do": "HOLD"})
    fleet.answer_instant("V1", ActionStatus.FAILED)
    assert fleet.cancelled == ["V1"]
    fleet.confirm_cancel("V1")

    assert "the action has failed" in status_of(engine).reason
    assert status_of(engine).held


async def test_an_order_that_is_finished_in_spite_of_its_cancel_has_not_failed() -> None:
    engine, fleet = await failing({"do": "RETRY"}, {"do": "HOLD"})
    fleet.answer_instant("V1", ActionStatus.FAILED)
    assert fleet.cancelled == ["V1"]
    fleet.finish("V1")

    assert status_of(engine).state is S.FINISHED


async def test_without_a_policy_nothing_is_retriable() -> None:
    _, fleet = await failing()

    assert fleet.sent[0][1].actions[0].retriable is None
    assert [kind for kind, _ in answers(fleet)] == ["skipRetry"]
