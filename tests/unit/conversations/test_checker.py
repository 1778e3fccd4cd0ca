"""A conversation of several robots, in several versions."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import timedelta
from typing import Any

import pytest

from nena_conversations.checker import Checker
from nena_conversations.recording import Entry
from nena_conversations.rules import MESSAGES, Rule, Severity
from nena_shared.vda5050.action import Action, ActionState, ActionStatus, InstantActions
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.factsheet import ActionScope, Factsheet, MobileRobotAction
from nena_shared.vda5050.request import RequestStatus, ZoneRequest, ZoneRequestType
from nena_shared.vda5050.topics import Topic
from nena_shared.vda5050.versions import CODECS, codec_for
from support.fleet_examples import factsheet
from support.fleet_examples import state as example_state
from support.robot_core import action, order, position
from support.talk import HEADER, START, Talk
from support.zones import responses

IN_3 = tuple(each for each in CODECS if each >= "3")


@pytest.mark.parametrize("version", CODECS)
def test_an_order_that_is_driven_to_its_end_is_fine(version: str) -> None:
    talk = Talk(version).online().state("n0", of="")
    talk.order("n0", "n1", "n2").state("n0", "n1", "n2").state("n1", "n2").state("n2").online("OFFLINE")

    assert talk.findings == []


def test_other_topics_and_clearing_messages_are_ignored() -> None:
    checker = Checker()
    for entry in Talk().raw("house/kitchen/light", b"on").raw("fleet/v3/ACME/0001/connection", b"").entries:
        assert list(checker.add(entry)) == []

    assert checker.checked == 0
    assert list(checker.end()) == []


def test_robots_are_checked_separately() -> None:
    talk = Talk().order("n0", "n1").state("n0", "n1")
    other = Talk().order("n0", "n1", order_id="o9").state("n0", of="o9", node_states=())
    talk.entries += [
        replace(
            each, topic=each.topic.replace("0001", "0002"), payload=each.payload.replace(b"0001", b"0002")
        )
        for each in other.entries
    ]

    assert talk.findings == []


def test_robot_that_changes_its_version_starts_a_new_conversation() -> None:
    talk = Talk("2.1.0").order("n0", "n1").state("n0", "n1")
    talk.entries += Talk("3.0.0").online().state("n0", of="").entries

    assert talk.findings == []


def test_numbers_include_skipped_messages() -> None:
    checker = Checker()
    checker.skip()
    (finding,) = checker.add(Entry(START, "fleet/v2/ACME/1/state", b"?"))

    assert (finding.number, checker.checked) == (2, 1)


def test_a_finding_is_an_object_for_scripts() -> None:
    checker = Checker()
    (finding,) = checker.add(Entry(START, "fleet/v2/ACME/1/state", b"?"))

    assert finding.as_json() == {
        "number": 1,
        "time": "2026-01-01T00:00:00+00:00",
        "robot": "ACME/1",
        "topic": "state",
        "version": "2.1.0",
        "rule": "message",
        "section": "6.10.6",
        "severity": "error",
        "text": finding.text,
    }


def test_rules_have_unique_codes_and_a_section() -> None:
    assert len({rule.code for rule in Rule}) == len(Rule)
    assert set(MESSAGES) == set(Topic)
    for rule in Rule:
        assert any(rule.section(version, Topic.ORDER) for version in CODECS), rule


def sent(version: str, topic: str, payload: bytes) -> Talk:
    return Talk(version).raw(f"fleet/{codec_for(version).major_version}/ACME/r1/{topic}", payload)


def changed(version: str, **fields: Any) -> Talk:
    """Return a conversation of one state, with some fields of its JSON replaced."""
    content = json.loads(codec_for(version).encode(example_state())) | fields
    return sent(version, "state", json.dumps(content).encode())


@pytest.mark.parametrize("version", CODECS)
def test_a_message_in_order_is_fine(version: str) -> None:
    assert changed(version).findings == []


@pytest.mark.parametrize(
    ("version", "topic", "section"),
    [
        ("2.0.0", "order", "6.7"),
        ("2.1.0", "order", "6.6.6"),
        ("3.0.0", "order", "7.3"),
        ("2.0.0", "factsheet", "7"),
        ("2.1.0", "state", "6.10.6"),
        ("3.0.0", "responses", "7.5"),
        ("2.1.0", "responses", "6.5"),
    ],
)
def test_malformed_message_is_reported_with_its_section(version: str, topic: str, section: str) -> None:
    talk = sent(version, topic, json.dumps({"version": version}).encode())

    assert {each.rule for each in talk.findings} == {Rule.MESSAGE}
    finding = talk.findings[0]
    assert (finding.number, finding.severity, finding.section) == (1, Severity.ERROR, section)
    assert str(finding.robot) == "ACME/r1"


def test_deviations_are_described_as_by_the_services() -> None:
    found = changed("2.1.0", errors=None, orderUpdateId="0").findings
    assert [(each.rule, each.severity) for each in found] == [(Rule.MESSAGE, Severity.ERROR)] * 2
    words = [each.text for each in found]
    assert sorted(words) == [
        "state.errors null: empty list",
        'state.orderUpdateId "0": text as number',
    ]


def test_deviations_of_a_fleet_control_are_described_as_by_the_agent() -> None:
    payload = codec_for("2.1.0").encode(order("n0", "n1"))
    changed_payload = payload.replace(b'"orderUpdateId":0', b'"orderUpdateId":"0"')
    (finding,) = sent("2.1.0", "order", changed_payload).findings
    assert finding.text == 'order.orderUpdateId "0": text as number'


def test_version_of_invalid_json_is_taken_from_the_topic() -> None:
    (finding,) = sent("2.1.0", "state", b"hello").findings

    assert (finding.rule, finding.version) == (Rule.MESSAGE, "2.1.0")


@pytest.mark.parametrize(("version", "section"), [("2.0.0", "6.6.1"), ("3.0.0", "6.1.1")])
@pytest.mark.parametrize(
    ("before", "after", "rule", "words"),
    [
        (b'"sequenceId":2', b'"sequenceId":4', Rule.SEQUENCE, "sequenceId 4, not 2"),
        (b'"sequenceId":2,"released":true', b'"sequenceId":2,"released":false', Rule.BASE, "not both"),
        (b'"edges":[', b'"edges":[],"others":[', Rule.GRAPH, "require 1 edges"),
    ],
)
def test_a_graph_that_a_schema_would_let_pass_is_named(
    *, version: str, section: str, before: bytes, after: bytes, rule: Rule, words: str
) -> None:
    good = codec_for(version).encode(order("n0", "n1"))
    assert before in good
    talk = sent(version, "order", good.replace(before, after))

    (finding,) = talk.findings
    assert (finding.rule, finding.section) == (rule, section)
    assert words in finding.text


@pytest.mark.parametrize("version", CODECS)
def test_a_key_with_two_values_is_an_error(version: str) -> None:
    payload = codec_for(version).encode(order("n0", "n1"))
    finding, _ = sent(version, "order", b'{"orderId":"x",' + payload[1:]).findings

    assert (finding.rule, finding.severity) == (Rule.MESSAGE, Severity.ERROR)
    assert finding.text.startswith("orderId: is there twice")


@pytest.mark.parametrize("stated", ["2.1.0", "2.1"])
@pytest.mark.parametrize(("name", "other"), [("manufacturer", "acme"), ("serialNumber", "R1")])
def test_a_name_in_other_letters_than_the_topic_s_is_an_error(name: str, other: str, stated: str) -> None:
    """In a message that is right otherwise, and in one that is not."""
    content = json.loads(codec_for("2.1.0").encode(example_state()))
    content |= {"manufacturer": "ACME", "serialNumber": "r1", "version": stated, name: other}

    assert other in sent("2.1.0", "state", json.dumps(content).encode()).texts


def test_a_unit_in_doubt_is_told_once() -> None:
    talk = Talk("2.1.0")
    power = example_state().power_supply.model_copy(update={"state_of_charge": 0.85})
    for _ in range(3):
        talk.state(power_supply=power)

    texts = [each.text for each in talk.findings]
    assert texts == ["batteryState.batteryCharge 0.85 (a fraction?): unit in doubt"]


@pytest.mark.parametrize("version", CODECS)
def test_a_field_that_the_version_does_not_have_is_a_warning(version: str) -> None:
    (finding,) = changed(version, colour="red").findings

    assert (finding.rule, finding.severity) == (Rule.FIELD, Severity.WARNING)
    assert finding.text.startswith("colour ")


def test_field_of_another_version_is_unknown() -> None:
    zone_sets: list[Any] = []

    assert changed("3.0.0", zoneSets=zone_sets).findings == []
    assert changed("2.1.0", zoneSets=zone_sets).rules == [Rule.FIELD]


def test_fields_deep_inside_are_named_by_their_path() -> None:
    payload = json.loads(codec_for("2.1.0").encode(order("n0", "n1")))
    payload["nodes"][1]["nodePosition"]["z"] = 3.0

    assert sent("2.1.0", "order", json.dumps(payload).encode()).texts.startswith("nodes.1.nodePosition.z ")


def test_accepted_misspelling_is_reported() -> None:
    (finding,) = changed("3.0.0", operatingMode="TEACHIN").findings

    assert (finding.rule, finding.severity, finding.section) == (Rule.SPELLING, Severity.ERROR, "7.1")
    assert "'TEACHIN'" in finding.text
    assert "'TEACH_IN'" in finding.text
    assert changed("2.1.0", operatingMode="TEACHIN").findings == []


def test_an_instant_action_of_3_blocks_nothing() -> None:
    pause = InstantActions(**HEADER, actions=(action("a", "HARD", "startPause"),))
    payload = codec_for("2.1.0").encode(pause)

    assert sent("2.1.0", "instantActions", payload).rules == []
    (finding,) = sent("3.0.0", "instantActions", payload.replace(b'"2.1.0"', b'"3.0.0"')).findings
    assert finding.rule is Rule.SPELLING
    assert "actions.0.blockingType is written 'HARD'; this version writes 'NONE'" in finding.text


def test_autoack_is_a_value_of_2_x() -> None:
    stop = {"eStop": "AUTOACK", "fieldViolation": False}

    assert changed("2.1.0", safetyState=stop).findings == []


@pytest.mark.parametrize(
    ("timestamp", "rules"),
    [
        ("2026-01-01T00:00:00Z", []),
        ("2026-01-01T00:00:00.123456Z", []),
        ("2026-01-01T01:00:00.00+01:00", [Rule.SPELLING]),
        ("2026-01-01T00:00:00.00", [Rule.SPELLING]),
    ],
)
def test_times_are_written_in_utc(timestamp: str, rules: list[Rule]) -> None:
    assert changed("2.1.0", timestamp=timestamp).rules == rules


@pytest.mark.parametrize("version", CODECS)
def test_values_are_compared_in_the_form_of_their_version(version: str) -> None:
    places = {"n0": position(0.0), "n1": position(10.0, radius=0.5)}

    assert Talk(version).order("n0", "n1", positions=places).findings == []


def test_findings_per_message_are_limited() -> None:
    assert len(changed("3.0.0", **{f"x{number}": 1 for number in range(50)}).findings) == 5


def test_a_topic_of_another_major_version_is_named() -> None:
    talk = Talk().raw("fleet/v2/ACME/r1/state", codec_for("3.0.0").encode(example_state()))

    assert talk.rules == [Rule.VERSION]


def test_header_of_another_robot_is_reported() -> None:
    assert Talk().say(example_state(), serial_number="0002").rules == [Rule.ADDRESS]


@pytest.mark.parametrize(("number", "rules"), [(1, []), (0, []), (3, [Rule.HEADER_ID])])
def test_header_ids_are_counted(number: int, rules: list[Rule]) -> None:
    talk = Talk().state("", of="").say(example_state(), header_id=number)

    assert talk.rules == rules


def test_header_ids_restart_after_the_last_number() -> None:
    talk = Talk().say(example_state(), header_id=2**32 - 1).say(example_state(), header_id=0)

    assert talk.rules == []


def test_each_topic_has_its_own_count() -> None:
    talk = Talk().say(example_state(), header_id=40).act()

    assert talk.rules == []


def test_time_does_not_go_back() -> None:
    talk = Talk().state("", of="").say(example_state(), timestamp=START - timedelta(hours=1))

    assert talk.rules == [Rule.TIMESTAMP]


def test_a_last_will_may_be_old() -> None:
    talk = Talk().online().state("", of="")
    will = Connection(**HEADER, connection_state=ConnectionState.CONNECTION_BROKEN)

    assert talk.say(will, timestamp=START - timedelta(hours=1), header_id=0).findings == []


def test_retained_message_belongs_to_an_earlier_time() -> None:
    talk = Talk().state("", of="")
    kept = Entry(START, "fleet/v3/ACME/r1/state", codec_for("3.0.0").encode(example_state()), retain=True)
    talk.entries.insert(0, kept)

    assert talk.rules == []


@pytest.mark.parametrize("version", CODECS)
def test_state_is_due_every_30_seconds(version: str) -> None:
    fine = Talk(version).online().state("n0", of="").wait(29).state("n0", of="")
    late = Talk(version).online().state("n0", of="").wait(40).state("n0", of="")

    assert fine.rules == []
    (finding,) = late.findings
    assert (finding.rule, finding.severity) == (Rule.STATE_INTERVAL, Severity.ERROR)
    assert finding.section == ("6.6" if version >= "3" else "6.10")


def test_state_is_due_as_often_as_the_factsheet_says() -> None:
    def talk(interval: float, pause: float) -> list[Rule]:
        begun = Talk().online().say(factsheet(version="3.0.0", state_interval=interval))
        return begun.state("n0", of="").wait(pause).state("n0", of="").rules

    assert talk(60.0, 62) == []
    assert talk(60.0, 70) == [Rule.STATE_INTERVAL]
    assert talk(2.0, 10) == [Rule.STATE_INTERVAL]


def test_silence_is_reported_while_others_send() -> None:
    talk = Talk().online().state("n0", of="").wait(60)
    talk.entries.append(Entry(talk.now, "fleet/v3/ACME/0002/state", b"?"))

    first = talk.findings[0]
    assert (first.rule, first.number) == (Rule.STATE_INTERVAL, 2)
    assert talk.state("n0", of="").rules.count(Rule.STATE_INTERVAL) == 1


@pytest.mark.parametrize("away", ["OFFLINE", "HIBERNATING", "CONNECTION_BROKEN"])
def test_disconnected_robot_sends_no_states(away: str) -> None:
    talk = Talk().online().state("n0", of="").online(away).wait(400).online().state("n0", of="")

    assert talk.findings == []


@pytest.mark.parametrize(
    ("away", "severity"),
    [
        ("OFFLINE", Severity.ERROR),
        ("HIBERNATING", Severity.ERROR),
        ("CONNECTION_BROKEN", Severity.WARNING),
    ],
)
def test_states_of_a_disconnected_robot_are_reported(away: str, severity: Severity) -> None:
    talk = Talk().online().state("n0", of="").online(away).state("n0", of="").state("n0", of="")

    (finding,) = talk.findings
    assert (finding.rule, finding.severity, finding.number) == (Rule.CONNECTION, severity, 4)


def hibernation(at: str = "2026-01-02T00:00:00.000Z") -> Action:
    return action("s", "NONE", "startHibernation", wakeUpTime=at)


def reported(status: str) -> tuple[ActionState, ...]:
    return (ActionState(action_id="s", action_type="startHibernation", action_status=ActionStatus(status)),)


@pytest.mark.parametrize("version", IN_3)
def test_a_robot_hibernates_and_wakes_as_the_standard_has_it(version: str) -> None:
    wake = action("w", "NONE", "stopHibernation")
    awake = (*reported("FINISHED"), ActionState(action_id="w", action_status=ActionStatus.FINISHED))
    talk = Talk(version).online().state("n0", of="").act(hibernation())
    talk.state("n0", of="", instant_action_states=reported("FINISHED")).online("HIBERNATING").wait(4000)
    talk.act(wake).wait(60).online().state("n0", of="", instant_action_states=awake)

    assert talk.findings == []


@pytest.mark.parametrize("status", ["RUNNING", None])
def test_hibernation_before_its_announcement_is_an_error(status: str | None) -> None:
    talk = Talk().online().state("n0", of="").act(hibernation())
    if status:
        talk.state("n0", of="", instant_action_states=reported(status))

    (finding,) = talk.online("HIBERNATING").findings
    assert (finding.rule, finding.severity) == (Rule.CONNECTION, Severity.ERROR)
    assert finding.text == "the robot hibernates before a state shows the end of 's'"


def test_commands_to_a_hibernating_robot_are_reported() -> None:
    talk = Talk().online().state("n0", of="").online("HIBERNATING")
    talk.act(action("i", "NONE", "stateRequest"), action("w", "NONE", "stopHibernation")).order("n0", "n1")

    assert [(each.rule, each.severity) for each in talk.findings] == [(Rule.CONNECTION, Severity.WARNING)] * 2
    assert "stateRequest is sent to a hibernating robot" in talk.texts
    assert "order 'o1' is sent to a hibernating robot" in talk.texts


@pytest.mark.parametrize("at", ["2026-01-02", "2026-01-02T00:00:00+01:00", "tomorrow"])
def test_a_wake_up_time_is_written_in_utc(at: str) -> None:
    (finding,) = Talk("3.0.1").online().state("n0", of="").act(hibernation(at)).findings

    assert (finding.rule, finding.severity) == (Rule.SPELLING, Severity.WARNING)
    assert f'"{at}"' in finding.text


def test_a_hibernation_needs_no_wake_up_time() -> None:
    talk = Talk("3.0.1").online().state("n0", of="").act(action("s", "NONE", "startHibernation"))

    assert talk.findings == []


def test_robot_without_a_recorded_connection_may_be_connected() -> None:
    assert Talk().state("n0", of="").findings == []


def offering(*scopes: ActionScope) -> Factsheet:
    sheet = factsheet()
    work = MobileRobotAction(
        action_type="work", action_scopes=scopes, pause_allowed=False, cancel_allowed=False
    )
    features = sheet.protocol_features.model_copy(update={"mobile_robot_actions": (work,)})
    return sheet.model_copy(update={"protocol_features": features})


@pytest.mark.parametrize("version", CODECS)
@pytest.mark.parametrize(
    ("asked", "place", "fine"),
    [
        (action("a"), {"node_actions": "n0"}, True),
        (action("a"), {"edge_actions": "n0-n1"}, False),
        (action("a", "NONE", "dance"), {"node_actions": "n0"}, False),
    ],
)
def test_actions_of_orders_are_offered(
    version: str, asked: Action, place: dict[str, str], *, fine: bool
) -> None:
    talk = Talk(version).say(offering(ActionScope.NODE))
    fields: dict[str, Any] = {key: {name: [asked]} for key, name in place.items()}
    talk.order("n0", "n1", **fields)

    assert talk.rules == ([] if fine else [Rule.NOT_OFFERED])
    assert {each.severity for each in talk.findings} <= {Severity.WARNING}


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"arrays": {"order.nodes": 1}}, "nodes has a length of 2"),
        ({"arrays": {"order.edges": 1}}, ""),
        ({"arrays": {"node.actions": 1}}, "actions of node 'n0' has a length of 2"),
        ({"strings": {"maximum_id_length": 4}}, "the ID 'n0-n1' has a length of 5"),
        ({"strings": {"maximum_message_length": 100}}, "the message has a length of"),
    ],
)
def test_orders_keep_the_limits_of_the_factsheet(limits: dict[str, Any], words: str) -> None:
    talk = Talk().say(factsheet(**limits))
    talk.order("n0", "n1", node_actions={"n0": [action("a"), action("b")]})
    found = [each for each in talk.findings if each.rule is Rule.LIMITS]

    assert [words in each.text for each in found] == ([True] if words else [])


def test_instant_actions_keep_the_limits_of_the_factsheet() -> None:
    talk = Talk().say(factsheet(arrays={"instantActions": 1})).act(action("a"), action("b"))

    assert Rule.LIMITS in talk.rules


@pytest.mark.parametrize(("pause", "rules"), [(1.0, []), (0.0, [Rule.ORDER_INTERVAL])])
def test_orders_do_not_come_faster_than_the_factsheet_allows(pause: float, rules: list[Rule]) -> None:
    talk = Talk().say(factsheet(order_interval=2.0)).order("n0", "n1", "n2", released=2).wait(pause)

    assert talk.order("n1", "n2", first=2, update=1).rules == rules


@pytest.mark.parametrize("connection", ["OFFLINE", "CONNECTION_BROKEN", "ONLINE"])
def test_orders_are_for_robots_that_are_there(connection: str) -> None:
    found = Talk().online(connection).order("n0", "n1").findings

    assert [(each.rule, each.severity) for each in found] == (
        [] if connection == "ONLINE" else [(Rule.OFFLINE, Severity.WARNING)]
    )


def test_instant_actions_are_offered() -> None:
    fine = Talk().say(offering(ActionScope.INSTANT)).act(action("a"))
    not_here = Talk().say(offering(ActionScope.NODE)).act(action("a"))

    assert fine.rules == []
    assert not_here.rules == [Rule.NOT_OFFERED]
    assert not_here.findings[0].section == "7.10"


def test_transform_is_unknown_without_a_factsheet() -> None:
    assert Talk().act(action("a", "NONE", "dance")).rules == []


@pytest.mark.parametrize(("version", "section"), [("2.0.0", "6.7"), ("2.1.0", "6.6.6"), ("3.0.0", "7.3")])
def test_action_id_identifies_one_type(version: str, section: str) -> None:
    talk = Talk(version).act(action("a", "NONE", "startPause")).act(action("a", "NONE", "stopPause"))

    (finding,) = talk.findings
    assert (finding.rule, finding.severity, finding.section) == (Rule.ACTION_ID, Severity.ERROR, section)


def test_an_action_id_belongs_to_one_order() -> None:
    talk = Talk().order("n0", node_actions={"n0": [action("a")]})
    talk.order("n0", order_id="o2", node_actions={"n0": [action("a")]})

    (finding,) = talk.findings
    assert (finding.rule, finding.severity) == (Rule.ACTION_ID, Severity.WARNING)
    assert "order 'o1'" in finding.text


@pytest.mark.parametrize("version", CODECS)
def test_repetition_may_reuse_its_ids(version: str) -> None:
    again = {"n0": [action("a")]}
    talk = Talk(version).order("n0", node_actions=again).order("n0", node_actions=again)
    talk.act(action("i", "NONE", "startPause")).act(action("i", "NONE", "startPause"))

    assert talk.rules == []


REQUEST = ZoneRequest(
    request_id="r",
    request_type=ZoneRequestType.ACCESS,
    zone_id="z",
    zone_set_id="s",
    request_status=RequestStatus.REQUESTED,
)


@pytest.mark.parametrize(("request_id", "rules"), [("r", []), ("q", [Rule.RESPONSE])])
def test_fleet_control_answers_only_requests(request_id: str, rules: list[Rule]) -> None:
    talk = Talk().state("n0", of="", zone_requests=(REQUEST,)).state("n0", of="")

    assert talk.say(responses(request_id, "GRANTED")).rules == rules


def test_answer_to_an_unrecorded_request_is_accepted() -> None:
    assert Talk().say(responses("r", "GRANTED")).rules == []


def test_retained_command_belongs_to_an_earlier_time() -> None:
    talk = Talk().order("n3", "n4", first=6, update=4)
    talk.entries = [replace(each, retain=True) for each in talk.entries]
    for _ in range(4):
        talk.state("n0", of="")

    (finding,) = talk.findings
    assert (finding.rule, finding.severity) == (Rule.RETAINED, Severity.WARNING)
