"""Each rule of the checker: a conversation that breaks it, and one that does not."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any, Self

import pytest

from nena_cli.vda5050.checker import check
from nena_cli.vda5050.finding import Finding, Rule, Severity
from nena_cli.vda5050.recording import Entry
from nena_shared.vda5050.action import Action, ActionState, ActionStatus, InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.error import ErrorType, error
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.state import OperatingMode, State
from nena_shared.vda5050.versions import codec_for
from support.fleet_examples import state as example_state
from support.robot_core import action, order

START = datetime(2026, 1, 1, tzinfo=UTC)
TOPICS = {Order: "order", InstantActions: "instantActions", State: "state", Connection: "connection"}


class Talk:
    """A conversation in the making; a second passes from message to message."""

    def __init__(self, version: str = "3.0.0") -> None:
        self.version = version
        self.codec = codec_for(version)
        self.entries: list[Entry] = []
        self.now = START
        self._numbers: dict[str, int] = {}

    def say(self, message: Header, **header: Any) -> Self:
        topic = TOPICS[type(message)]
        number = self._numbers[topic] = self._numbers.get(topic, -1) + 1
        self.now += timedelta(seconds=1)
        fields = {"header_id": number, "timestamp": self.now, "manufacturer": "ACME", "serial_number": "0001"}
        payload = self.codec.encode(message.model_copy(update=fields | header))
        return self.raw(f"fleet/{self.codec.major_version}/ACME/0001/{topic}", payload)

    def raw(self, topic: str, payload: bytes) -> Self:
        self.entries.append(Entry(self.now, topic, payload))
        return self

    def order(self, *nodes: str, **fields: Any) -> Self:
        return self.say(order(*nodes, **fields))

    def act(self, *actions: Action) -> Self:
        header = example_state().model_dump(include=set(Header.model_fields))
        return self.say(InstantActions(**header, actions=actions))

    def state(self, last: str = "n0", *left: str, of: str = "o1", update: int = 0, **fields: Any) -> Self:
        """Say a state that is on the node ``last``, with the nodes ``left`` before it."""
        number = int(last[1:]) * 2 if last else 0
        nodes = tuple({"node_id": each, "sequence_id": int(each[1:]) * 2, "released": True} for each in left)
        content = {
            "order_id": of,
            "order_update_id": update,
            "last_node_id": last,
            "last_node_sequence_id": number,
            "node_states": nodes,
            **fields,
        }
        return self.say(example_state(**content))

    def online(self, state: str = "ONLINE") -> Self:
        header = example_state().model_dump(include=set(Header.model_fields))
        return self.say(Connection(**header, connection_state=ConnectionState(state)))

    def wait(self, seconds: float) -> Self:
        self.now += timedelta(seconds=seconds)
        return self

    @property
    def findings(self) -> list[Finding]:
        return list(check(self.entries))

    @property
    def rules(self) -> list[Rule]:
        return [each.rule for each in self.findings]


def doing(*statuses: tuple[str, str]) -> tuple[ActionState, ...]:
    return tuple(
        ActionState(action_id=action_id, action_type="work", action_status=ActionStatus(status))
        for action_id, status in statuses
    )


@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.0.0"])
def test_an_order_that_is_driven_to_its_end_is_fine(version: str) -> None:
    talk = Talk(version).online().state("n0", of="")
    talk.order("n0", "n1", "n2").state("n0", "n1", "n2").state("n1", "n2").state("n2")

    assert talk.findings == []


def test_what_is_no_message_is_named_with_its_section() -> None:
    talk = Talk("2.1.0").online().raw("fleet/v2/ACME/0001/state", b'{"headerId": 1}')

    assert {each.rule for each in talk.findings} == {Rule.MESSAGE}
    finding = talk.findings[0]
    assert (finding.number, finding.severity, finding.section) == (2, Severity.ERROR, "7.1")
    assert str(finding.robot) == "ACME/0001"


def test_a_graph_that_a_schema_would_let_pass_is_named() -> None:
    good = codec_for("3.0.0").encode(order("n0", "n1"))
    talk = Talk().raw("fleet/v3/ACME/0001/order", good.replace(b'"sequenceId":2', b'"sequenceId":4'))

    assert talk.rules == [Rule.MESSAGE]
    assert "sequenceId 4, not 2" in talk.findings[0].text


def test_other_topics_and_cleared_messages_are_passed_over() -> None:
    talk = Talk().raw("house/kitchen/light", b"on").raw("fleet/v3/ACME/0001/connection", b"")

    assert talk.findings == []


def test_a_topic_of_another_major_version_is_named() -> None:
    payload = codec_for("3.0.0").encode(example_state())
    talk = Talk().raw("fleet/v2/ACME/r1/state", payload)

    assert talk.rules == [Rule.VERSION]


def test_a_header_of_another_robot_is_named() -> None:
    talk = Talk().say(example_state(), serial_number="0002")

    assert talk.rules == [Rule.ADDRESS]


@pytest.mark.parametrize(("number", "rules"), [(1, []), (0, []), (3, [Rule.HEADER_ID])])
def test_header_ids_are_counted(number: int, rules: list[Rule]) -> None:
    talk = Talk().state("", of="").say(example_state(), header_id=number)

    assert talk.rules == rules


def test_time_does_not_go_back() -> None:
    talk = Talk().state("", of="").say(example_state(), timestamp=START - timedelta(hours=1))

    assert talk.rules == [Rule.TIMESTAMP]


def test_a_last_will_may_be_old() -> None:
    talk = Talk().online().state("", of="")
    header = example_state().model_dump(include=set(Header.model_fields))
    will = Connection(**header, connection_state=ConnectionState.CONNECTION_BROKEN)

    assert talk.say(will, timestamp=START - timedelta(hours=1), header_id=0).findings == []


@pytest.mark.parametrize(("version", "rules"), [("2.1.0", []), ("3.0.0", [Rule.FIRST_UPDATE])])
def test_a_new_order_begins_with_update_0_where_the_version_says_so(version: str, rules: list[Rule]) -> None:
    talk = Talk(version).state("n0", of="").order("n0", "n1", update=3)

    assert talk.rules == rules


def test_a_new_order_begins_with_its_beginning() -> None:
    assert Talk().state("n0", of="").order("n1", "n2", first=2).rules == [Rule.FIRST_UPDATE]
    middle = Talk().state("n1", "n2", of="o1").order("n2", "n3", first=4, update=1)
    assert middle.rules == []


def test_a_new_order_is_for_an_idle_robot() -> None:
    talk = Talk().order("n0", "n1").state("n0", "n1").order("n1", "n2", order_id="o2")

    assert talk.rules == [Rule.OTHER_ORDER]


def test_a_robot_in_manual_mode_gets_no_order() -> None:
    talk = Talk().state("n0", of="", operating_mode=OperatingMode.MANUAL).order("n0", "n1")

    assert talk.rules == [Rule.MODE]


def test_an_update_begins_at_the_decision_point() -> None:
    talk = Talk().order("n0", "n1", "n2", released=2).state("n0", "n1")
    good = Talk().order("n0", "n1", "n2", released=2).state("n0", "n1")

    talk.order("n2", "n3", first=4, update=1)
    good.order("n1", "n3", first=2, update=1)

    assert talk.rules == [Rule.STITCHING]
    assert good.rules == []


@pytest.mark.parametrize(("version", "rules"), [("2.1.0", []), ("3.0.0", [Rule.STITCHING])])
def test_the_decision_point_is_repeated_in_full_where_the_version_says_so(
    version: str, rules: list[Rule]
) -> None:
    work = {"n1": [action("a")]}
    talk = Talk(version).order("n0", "n1", node_actions=work)
    talk.state("n0", "n1", action_states=doing(("a", "WAITING")))

    talk.order("n1", "n2", first=2, update=1)

    assert talk.rules == rules


def test_update_ids_rise() -> None:
    talk = Talk().order("n0", "n1").order("n1", "n2", first=2, update=2).order("n2", "n3", first=4, update=1)

    assert talk.rules == [Rule.UPDATE_ID]


@pytest.mark.parametrize(("version", "rules"), [("2.1.0", []), ("3.0.0", [Rule.UPDATE_ID])])
def test_the_same_update_id_says_the_same(version: str, rules: list[Rule]) -> None:
    repeated = Talk(version).order("n0", "n1").order("n0", "n1")
    changed = Talk(version).order("n0", "n1").order("n0", "n2")

    assert repeated.rules == []
    assert changed.rules == rules


def test_a_cancelled_order_gets_no_update() -> None:
    cancel = action("c", "NONE", "cancelOrder")
    talk = Talk().order("n0", "n1").state("n0", "n1").act(cancel)
    talk.state("n0", instant_action_states=doing(("c", "FINISHED"))).order("n1", "n2", first=2, update=1)

    assert talk.rules == [Rule.UPDATE_AFTER_CANCEL]


def test_a_cancel_ends_with_nothing_left() -> None:
    talk = Talk().order("n0", "n1").state("n0", "n1").act(action("c", "NONE", "cancelOrder"))
    talk.state("n0", "n1", instant_action_states=doing(("c", "FINISHED")))

    assert talk.rules == [Rule.CANCEL_END]


def test_an_order_is_answered_by_an_echo_or_an_error() -> None:
    silent = Talk().order("n0", "n1")
    refused = Talk().order("n0", "n1")
    entry = error(ErrorType.NO_ROUTE_TO_TARGET, "no way", hint="", order_id="o1", order_update_id=0)
    for _ in range(4):
        silent.state("n0", of="")
        refused.state("n0", of="", errors=(entry,))

    (finding,) = silent.findings
    assert (finding.rule, finding.severity, finding.number) == (Rule.ANSWER, Severity.WARNING, 1)
    assert refused.findings == []


def test_a_refused_update_leaves_the_order_as_it_was() -> None:
    entry = error(ErrorType.NO_ROUTE_TO_TARGET, "no way", hint="", order_id="o1", order_update_id=1)
    talk = Talk().order("n0", "n1").state("n0", "n1").order("n1", "n2", first=2, update=1)
    talk.state("n0", "n1", errors=(entry,)).order("n1", "n3", first=2, update=2)

    assert talk.state("n1", "n2", update=2, node_states=()).findings == []


def test_nodes_leave_in_their_order() -> None:
    skipped = Talk().order("n0", "n1", "n2", "n3").state("n0", "n1", "n2", "n3").state("n0", "n3")
    back = Talk().order("n0", "n1", "n2").state("n1", "n2").state("n1", "n1", "n2")
    unknown = Talk().order("n0", "n1").state("n0", "n1", "n7")

    assert skipped.rules == [Rule.PROGRESS]
    assert "2 to 4" in skipped.findings[0].text
    assert Rule.PROGRESS in back.rules
    assert set(unknown.rules) == {Rule.PROGRESS}


def test_the_last_node_does_not_go_back() -> None:
    talk = Talk().order("n0", "n1", "n2", "n3").state("n2", "n3").state("n1", "n3")

    assert Rule.PROGRESS in talk.rules


def test_each_action_has_a_state() -> None:
    talk = Talk().order("n0", "n1", node_actions={"n1": [action("a")]}).state("n0", "n1")

    assert talk.rules == [Rule.ACTION_LOST]


@pytest.mark.parametrize(
    ("before", "after", "fine"),
    [
        ("WAITING", "FINISHED", True),
        ("RUNNING", "RETRIABLE", True),
        ("FINISHED", "RUNNING", False),
        ("FAILED", "FINISHED", False),
        ("RUNNING", "WAITING", False),
    ],
)
def test_statuses_change_as_the_figure_allows(before: str, after: str, *, fine: bool) -> None:
    talk = Talk().order("n0", node_actions={"n0": [action("a")]})
    talk.state("n0", action_states=doing(("a", before))).state("n0", action_states=doing(("a", after)))

    assert talk.rules == ([] if fine else [Rule.ACTION_STATUS])


def test_an_action_id_stands_for_one_action() -> None:
    talk = Talk().act(action("a", "NONE", "startPause")).act(action("a", "NONE", "stopPause"))

    assert talk.rules == [Rule.ACTION_ID]


def test_an_instant_action_is_answered() -> None:
    talk = Talk().act(action("a", "NONE", "startPause"))
    answered = Talk().act(action("a", "NONE", "startPause"))
    for _ in range(4):
        talk.state("n0", of="")
        answered.state("n0", of="", instant_action_states=doing(("a", "FINISHED")))

    assert talk.rules == [Rule.INSTANT_ANSWER]
    assert answered.rules == []


def test_a_state_comes_each_half_minute() -> None:
    late = Talk().online().state("n0", of="").wait(40).state("n0", of="")
    asleep = Talk().online().state("n0", of="").online("OFFLINE").wait(400).online().state("n0", of="")

    assert late.rules == [Rule.STATE_INTERVAL]
    assert asleep.rules == []


def test_robots_are_followed_each_for_itself() -> None:
    talk = Talk().order("n0", "n1").state("n0", "n1")
    other = Talk().order("n0", "n1", order_id="o9").state("n0", of="o9")
    talk.entries += [
        Entry(each.time, each.topic.replace("0001", "0002"), each.payload.replace(b"0001", b"0002"))
        for each in other.entries
    ]

    assert talk.findings == []
