"""Fleet control and the edge agent, each as it is, over a real broker."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from nena_order_service.fleet.outputs import InstantActionEnded, NodePassed, VdaOrderFailed
from nena_order_service.fleet.position import RobotProfile, locate
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.vda_order import OperationMap, build_vda_order, released_to
from nena_order_service.routing.router import Router
from nena_shared.fleet_api.transport_order import Coordinate
from nena_shared.plant import PlantModel
from nena_shared.vda5050.action import Action, ActionStatus, BlockingType
from nena_shared.vda5050.topics import RobotKey
from support.broker import Broker
from support.edge_agent import MANUFACTURER, QUICK, SERIAL, agent_settings, running_agent
from support.fleet import make_vda_order
from support.plants import path, point
from support.robot_core import MAP
from support.waiting import until
from support.wired_robot import WiredFleet

pytestmark = pytest.mark.broker

AGENT = RobotKey(MANUFACTURER, SERIAL)
PROFILE = RobotProfile(map_id=MAP)
PLANT = PlantModel(
    name="row",
    points=(point("A"), point("B", 2000), point("C", 4000, orientation_deg=90.0)),
    paths=(path("A B"), path("B C"), path("C A")),
)


async def start(fleet: WiredFleet, name: str, goal: str | Coordinate, operation: str = "MOVE") -> None:
    view = await until(
        lambda: fleet.fleet.view(AGENT) if fleet.fleet.view(AGENT).availability.can_take_order else None,
        what="a free agent",
    )
    assert view.state is not None
    standing = locate(PLANT, view.state, PROFILE)
    to_point = isinstance(goal, str)
    vda_order = build_vda_order(
        name,
        plant=PLANT,
        standing=standing,
        profile=PROFILE,
        route=Router(PLANT).route(standing.point, goal) if isinstance(goal, str) else None,
        coordinate=None if to_point else goal,  # type: ignore[arg-type] # a coordinate then
        actions=OperationMap().actions(operation, {}),
    )
    fleet.fleet.start_vda_order(AGENT, vda_order)


@pytest.mark.clause("6.2.3/pick")
async def test_drive_and_pick(fleet: WiredFleet, broker: Broker, interface_name: str, tmp_path: Path) -> None:
    async with running_agent(agent_settings(broker, interface_name, tmp_path)):
        await start(fleet, "m-0", "C", "Load cargo")
        await fleet.wait_for("VdaOrderFinished")
        passed = [each.node_id for each in fleet.news if isinstance(each, NodePassed)]
        assert passed == ["A", "B", "C"]
        assert "OperationStarted" in fleet.story()
        await start(fleet, "m-1", Coordinate(x=3.0, y=2.0, theta=1.0))
        await until(lambda: fleet.story().count("VdaOrderFinished") == 2, what="the coordinate reached")
        await start(fleet, "m-2", "A", "Unload cargo")
        await until(lambda: fleet.story().count("VdaOrderFinished") == 3, what="the load dropped")
        state = fleet.fleet.view(AGENT).state
        assert state is not None
        assert (state.last_node_id, state.loads) == ("A", ())


@pytest.mark.clause("7.10")
async def test_an_operation_that_the_robot_cannot_do_is_refused(
    fleet: WiredFleet, broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    async with running_agent(agent_settings(broker, interface_name, tmp_path)):
        await start(fleet, "m-0", "C", "dance")
        failed = await fleet.wait_for("VdaOrderFailed")
    assert isinstance(failed, VdaOrderFailed)
    assert str(failed.reason) == (
        "the robot cannot execute the order: its factsheet does not list the action 'dance'"
    )


@pytest.fixture
def slow() -> dict[str, Any]:
    return {"loopback": QUICK | {"speed": 0.6}}


@pytest.mark.clause("6.1.3/after", "6.1.1/first")
async def test_cancel_en_route_and_continue_from_there(
    fleet: WiredFleet, broker: Broker, interface_name: str, tmp_path: Path, slow: dict[str, Any]
) -> None:
    async with running_agent(agent_settings(broker, interface_name, tmp_path, **slow)):
        await start(fleet, "m-0", "C")
        await fleet.wait_for("VdaOrderAccepted")
        fleet.fleet.cancel_vda_order(AGENT)
        await fleet.wait_for("VdaOrderCancelled")
        assert 0.0 < _x(fleet) < 2.0, "it stands between A and B"
        await start(fleet, "m-1", "B")
        await fleet.wait_for("VdaOrderFinished")


@pytest.mark.clause("6.2.3/startPause", "6.2.3/stopPause")
async def test_pause_and_resume(
    fleet: WiredFleet, broker: Broker, interface_name: str, tmp_path: Path, slow: dict[str, Any]
) -> None:
    async with running_agent(agent_settings(broker, interface_name, tmp_path, **slow)):
        await start(fleet, "m-0", "B")
        await fleet.wait_for("VdaOrderAccepted")
        for action_type in ("startPause", "stopPause"):
            fleet.news.clear()
            action = Action(action_type=action_type, action_id=action_type, blocking_type=BlockingType.HARD)
            fleet.fleet.instant_action(AGENT, action)
            ended = await fleet.wait_for("InstantActionEnded")
            assert isinstance(ended, InstantActionEnded)
            assert ended.status is ActionStatus.FINISHED
            state = fleet.fleet.view(AGENT).state
            assert state is not None
            assert state.paused is (action_type == "startPause")
        await fleet.wait_for("VdaOrderFinished")


def _x(fleet: WiredFleet) -> float:
    state = fleet.fleet.view(AGENT).state
    assert state is not None
    assert state.mobile_robot_position is not None
    return state.mobile_robot_position.x


@pytest.mark.clause("6.1.2/fleet", "6.6.3/fleet", "6.6.3", "6.1.2/B6")
@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.0.0"])
async def test_a_base_is_extended_while_the_agent_drives(
    fleet: WiredFleet, broker: Broker, interface_name: str, tmp_path: Path, version: str
) -> None:
    async with running_agent(agent_settings(broker, interface_name, tmp_path, version=version)):
        await until(lambda: fleet.fleet.view(AGENT).availability.can_take_order, what="a free agent")
        whole = make_vda_order("m-0", "A", "B", "C", "D", operation="pick")
        fleet.fleet.start_vda_order(AGENT, released_to(whole, 2))
        await fleet.wait_for("BaseWanted")
        await until(
            lambda: [each.node_id for each in passed(fleet)] == ["A", "B"], what="the end of the base"
        )
        for sequence_id in (4, 6):
            fleet.fleet.extend_vda_order(AGENT, released_to(whole, sequence_id))
        await fleet.wait_for("VdaOrderFinished")

    assert [each.node_id for each in passed(fleet)] == ["A", "B", "C", "D"]


def passed(fleet: WiredFleet) -> list[NodePassed]:
    return [each for each in fleet.news if isinstance(each, NodePassed)]


@pytest.mark.clause("6.2.3/clearInstantActions")
async def test_a_3_0_agent_is_sent_clear_instant_actions(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    settings = FleetSettings(tick_interval=0.02, clear_instant_actions_from=3)
    async with (
        WiredFleet(broker, interface_name, settings).connected() as fleet,
        running_agent(agent_settings(broker, interface_name, tmp_path, version="3.0.0")),
    ):
        await until(lambda: fleet.fleet.view(AGENT).availability.can_take_order, what="a free agent")
        for number in range(3):
            action = Action(action_type="stopPause", action_id=f"a{number}", blocking_type=BlockingType.NONE)
            fleet.fleet.instant_action(AGENT, action)
        cleared = await until(lambda: _only_cleared(fleet), what="nothing but the clearing itself")
    assert cleared == ["clearInstantActions"]
    assert fleet.story().count("InstantActionEnded") == 3, "nobody asked for the clearing"


def _only_cleared(fleet: WiredFleet) -> list[str | None] | None:
    state = fleet.fleet.view(AGENT).state
    types = [each.action_type for each in state.instant_action_states] if state else []
    return types if types == ["clearInstantActions"] else None
