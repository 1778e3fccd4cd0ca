from __future__ import annotations

import json

import pytest

from nena_edge_agent.inbox import Inbox, InboxCounts
from nena_edge_agent.protocol.errors import Until
from nena_edge_agent.protocol.events import Event, InstantActionsReceived, MessageRefused, OrderReceived
from nena_shared.clock import ManualClock
from nena_shared.mqtt import Inbound
from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.error import ErrorType
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.v2_1 import CODEC
from support.robot_core import HEADER, action, order


class Desk:
    def __init__(self, serial: str = "0001") -> None:
        self.events: list[Event] = []
        self.inbox = Inbox(CODEC, RobotKey("ACME", serial), self.events.append, ManualClock())

    def order(self, payload: bytes, *, retained: bool = False) -> None:
        self.inbox.take_order(Inbound("x/order", payload, retained))

    @property
    def refusal(self) -> dict[str, str]:
        (event,) = self.events
        assert isinstance(event, MessageRefused)
        assert event.error.error_type == ErrorType.VALIDATION_FAILURE
        return {each.reference_key: each.reference_value for each in event.error.error_references}


def test_a_good_order_becomes_an_event() -> None:
    desk = Desk()

    desk.order(CODEC.encode(order("n0", "n1")))

    (event,) = desk.events
    assert isinstance(event, OrderReceived)
    assert [node.node_id for node in event.order.nodes] == ["n0", "n1"]
    assert desk.inbox.counts.taken == 1


def test_good_instant_actions_become_an_event() -> None:
    desk = Desk()

    desk.inbox.take_instant_actions(
        Inbound("x", CODEC.encode(InstantActions(**HEADER, actions=(action("a"),))), retained=False)
    )

    (event,) = desk.events
    assert isinstance(event, InstantActionsReceived)
    assert event.message.actions[0].action_id == "a"


@pytest.mark.clause("4.1/retain")
def test_a_retained_message_is_passed_over() -> None:
    desk = Desk()

    desk.order(CODEC.encode(order("n0")), retained=True)

    assert desk.events == []
    assert desk.inbox.counts.retained == 1


@pytest.mark.parametrize("retained", [True, False])
def test_an_empty_message_only_clears_what_the_broker_keeps(*, retained: bool) -> None:
    desk = Desk()

    desk.order(b"", retained=retained)

    assert desk.events == []
    assert desk.inbox.counts == InboxCounts()


@pytest.mark.clause("6.1.4.1")
@pytest.mark.parametrize("payload", [b" ", b"\xff", b"[]", b'"order"', b"{}", b"null"])
def test_rubbish_is_refused_and_counted(payload: bytes) -> None:
    desk = Desk()

    desk.order(payload)

    assert desk.refusal == {"topic": "order"}
    assert desk.inbox.counts.malformed == 1


@pytest.mark.clause("6.1.4.1", "6.6.5.2")
def test_what_can_be_read_of_a_broken_message_is_referenced() -> None:
    desk = Desk()
    content = json.loads(CODEC.encode(order("n0", "n1", order_id="o7", update=2)))
    content["edges"] = []

    desk.order(json.dumps(content).encode())

    assert desk.refusal == {"topic": "order", "headerId": "7", "orderId": "o7", "orderUpdateId": "2"}


@pytest.mark.clause("7.2")
def test_a_message_for_another_robot_is_refused() -> None:
    desk = Desk(serial="0002")

    desk.order(CODEC.encode(order("n0")))

    assert desk.refusal == {"topic": "order", "headerId": "7"}
    assert desk.inbox.counts.misdirected == 1


@pytest.mark.clause("6.2.1/refused")
def test_the_refusal_of_instant_actions_ends_with_the_next_ones_and_not_with_an_order() -> None:
    desk = Desk()

    desk.inbox.take_instant_actions(Inbound("x", b"{}", retained=False))
    desk.order(b"{}")

    assert [event.until for event in desk.events if isinstance(event, MessageRefused)] == [
        Until.INSTANT_ACTION_ACCEPTED,
        Until.ORDER_ACCEPTED,
    ]
