"""Recorded conversations, read again by fleet control and by the fleet model."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import pytest

from nena_conversations.message import ReceivedMessage
from nena_order_service.fleet.controller import FleetController
from nena_order_service.fleet.outputs import (
    FleetOutput,
    NodePassed,
    OperationStarted,
    PublishInstantActions,
    PublishOrder,
    VdaOrderAccepted,
    VdaOrderCancelled,
    VdaOrderFailed,
    VdaOrderFinished,
)
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import State
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.fleet.robot import Timestamp
from support.conversations import FOLDER
from support.talk import conversation

FILES = sorted(FOLDER.glob("*.jsonl"))
CANCEL = "cancelOrder"


class Fleet:
    """A fleet control that is to do what the recorded one did, and hears what it was answered."""

    def __init__(self, messages: list[ReceivedMessage]) -> None:
        self.messages = messages
        self.robot = messages[0].robot
        self.cancel_ids = [
            action.action_id
            for each in messages
            if isinstance(each.message, InstantActions)
            for action in each.message.actions
            if action.action_type == CANCEL
        ]
        self.controller = FleetController(FleetSettings(), new_id=iter(self.cancel_ids).__next__)
        self.controller.on_broker(connected=True, now=0.0)
        self.outputs: list[FleetOutput] = []

    def go_through(self) -> None:
        begin = self.messages[0].time
        for each in self.messages:
            now = (each.time - begin).total_seconds()
            self.outputs += self.turn(each, now)

    def turn(self, received: ReceivedMessage, now: float) -> Iterator[FleetOutput]:
        match received.message:
            case Connection() as message:
                yield from self.controller.on_connection(self.robot, message, now)
            case Factsheet() as message:
                yield from self.controller.on_factsheet(self.robot, message, now)
            case State() as message:
                yield from self.controller.on_state(self.robot, message, now)
            case Order() as order:
                vda_order = VdaOrder(order_id=order.order_id, nodes=order.nodes, edges=order.edges)
                yield from self.controller.control(self.robot).start_order(vda_order, now)
            case InstantActions() as message if message.actions[0].action_id in self.cancel_ids[:1]:
                yield from self.controller.control(self.robot).cancel_order(now)

    def news(self, *kinds: type[FleetOutput]) -> list[FleetOutput]:
        return [each for each in self.outputs if isinstance(each, kinds)]

    @property
    def orders(self) -> list[Order]:
        return [each.message for each in self.messages if isinstance(each.message, Order)]


def replayed(version: str, story: str) -> Fleet:
    fleet = Fleet(conversation(FOLDER / f"{version}-{story}.jsonl"))
    fleet.go_through()
    return fleet


@pytest.mark.parametrize(
    ("version", "story"),
    [
        *(
            (version, story)
            for version in ("2.0.0", "2.1.0", "3.0.0")
            for story in ("order_with_actions", "pause")
        ),
        ("3.0.0", "zones"),
    ],
)
def test_fleet_control_sends_the_same_order_and_follows_it_to_its_end(version: str, story: str) -> None:
    fleet = replayed(version, story)
    (order,) = fleet.orders
    robot, name = fleet.robot, order.order_id

    (sent,) = fleet.news(PublishOrder)
    assert isinstance(sent, PublishOrder)
    assert (sent.vda_order.order_id, sent.vda_order.nodes, sent.vda_order.edges) == (
        name,
        order.nodes,
        order.edges,
    )
    assert fleet.news(VdaOrderAccepted) == [VdaOrderAccepted(robot, name)]
    passed = [NodePassed(robot, name, node.node_id, node.sequence_id) for node in order.nodes]
    assert fleet.news(NodePassed) == passed
    started = [OperationStarted(robot, name)] if order.nodes[-1].actions else []
    assert fleet.news(OperationStarted) == started
    assert fleet.news(VdaOrderFinished, VdaOrderFailed) == [VdaOrderFinished(robot, name)]


@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.0.0"])
def test_fleet_control_cancels_the_same_way(version: str) -> None:
    fleet = replayed(version, "cancel")
    (order,) = fleet.orders

    (sent, *_) = fleet.news(PublishInstantActions)
    assert isinstance(sent, PublishInstantActions)
    assert [(each.action_type, each.action_id) for each in sent.actions] == [(CANCEL, fleet.cancel_ids[0])]
    ends = fleet.news(VdaOrderFinished, VdaOrderFailed, VdaOrderCancelled)
    assert ends == [VdaOrderCancelled(fleet.robot, order.order_id)]


@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.0.0"])
def test_fleet_control_understands_refusals(version: str) -> None:
    fleet = replayed(version, "refusals")
    far, dance, good = (order.order_id for order in fleet.orders)

    first, second, third = fleet.news(VdaOrderFailed, VdaOrderFinished)
    assert isinstance(first, VdaOrderFailed)
    assert isinstance(second, VdaOrderFailed)
    assert (first.order_id, second.order_id) == (far, dance)
    assert third == VdaOrderFinished(fleet.robot, good)


@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.0.0"])
def test_fleet_control_may_cancel_a_failed_order(version: str) -> None:
    fleet = replayed(version, "failure")
    (order,) = fleet.orders

    (sent, *_) = fleet.news(PublishInstantActions)
    assert isinstance(sent, PublishInstantActions)
    assert [(each.action_type, each.action_id) for each in sent.actions] == [(CANCEL, fleet.cancel_ids[0])]
    (end,) = fleet.news(VdaOrderFinished, VdaOrderFailed, VdaOrderCancelled)
    assert isinstance(end, VdaOrderFailed)
    assert end.order_id == order.order_id
    assert "it always fails" in " ".join((str(end.reason), *end.details))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_fleet_model_shows_the_robots_messages(file: Path) -> None:
    messages = conversation(file)
    model = FleetModel(ModelLimits())
    start = messages[0].time
    model.on_link(connected=True, at=Timestamp(0.0, start))
    for each in messages:
        at = Timestamp((each.time - start).total_seconds(), each.time)
        match each.message:
            case Connection() as message:
                model.on_connection(each.robot, message, at)
            case Factsheet() as message:
                model.on_factsheet(each.robot, message, at)
            case State() as message:
                model.on_state(each.robot, message, at)
                model.flush(at)
                view = model.robot_view(each.robot)
                assert view is not None
                assert (view["connection"], view["driving"]) == ("ONLINE", message.driving)
                assert [error["errorType"] for error in view["errors"]] == [
                    e.error_type for e in message.errors
                ]
                order = view["order"]
                if message.order_id:
                    assert order is not None
                    assert (order["orderId"], order["lastNodeId"]) == (message.order_id, message.last_node_id)

    model.flush(Timestamp(0.0, messages[-1].time + timedelta(seconds=1)))
    view = model.robot_view(messages[0].robot)
    assert view is not None
    assert (view["connection"], view["malformed"]) == ("OFFLINE", 0)
    assert view["protocolVersion"] == messages[0].codec.version
