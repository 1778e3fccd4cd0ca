"""The conformance kit with real agents: honest robots pass, and each fault is caught by its clause."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from uuid import uuid4

import pytest
from defusedxml import ElementTree

from nena_conversations.broker import BrokerAddress
from nena_conversations.kit import report, run
from nena_conversations.kit.clause import Outcome, Verdict
from nena_conversations.kit.robot_clauses import ROBOT_CLAUSES
from nena_conversations.kit.run import RobotUnderTest, first_state, judge_robot
from nena_conversations.kit.session import Person
from nena_shared.settings import MqttSettings
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.versions import codec_named, topics_for
from support.broker import Broker, MqttPeer
from support.edge_agent import MANUFACTURER, SERIAL, AgentProcess
from support.mutant_robot import Change, Message, mutant
from support.waiting import PATIENCE, until, wait_until

pytestmark = pytest.mark.broker

ROBOT = RobotKey(MANUFACTURER, SERIAL)
PLAN = ((1.0, 1.0), (3.0, 1.0), (3.0, 3.0))
VERSION = "2.1.0"
QUICK = 1.5
"""Seconds for answers: a fault that is an answer that never comes takes as long."""


@pytest.fixture(scope="module")
def agent(broker: Broker, tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Broker, str]]:
    """Yield a broker and the interface of an honest agent that has sent its first state."""
    interface = f"honest{uuid4().hex[:6]}"
    options = ("--version", VERSION, "--loopback.x", "1", "--loopback.y", "1", "--loopback.speed", "2")
    states = f"{interface}/+/+/+/state"
    with AgentProcess(broker, interface, tmp_path_factory.mktemp("journal"), *options):
        with MqttPeer(broker, states) as peer:
            wait_until(lambda: bool(peer.received(states)), what="the agent's first state")
        yield broker, interface


async def judged(
    agent: tuple[Broker, str],
    clauses: tuple[str, ...],
    *,
    plan: bool = True,
    person: Person | None = None,
    action: str = "pick",
    **changes: Any,
) -> dict[str, Verdict]:
    """Judge the agent with changed messages by some of the clauses, and by what the checker sees."""
    broker, interface = agent
    codec = codec_named(VERSION)
    chosen = [clause for clause in ROBOT_CLAUSES if clause.id in clauses]
    assert len(chosen) == len(clauses)
    address = BrokerAddress(MqttSettings(host=broker.host, port=broker.port), ())
    name = f"mutant{uuid4().hex[:6]}"
    async with mutant(broker, interface, name, ROBOT, codec, **changes) as topics:
        tested = RobotUnderTest(ROBOT, topics, codec, PLAN if plan else (), action)
        verdicts, _ = await judge_robot(
            address,
            tested,
            clauses=chosen,
            report=lambda _: None,
            client_id=f"test-{name}",
            answer_within=QUICK,
            person=person,
        )
    return {verdict.id: verdict for verdict in verdicts}


def on(topic: Topic, **fields: Any) -> Change:
    """Replace fields of the messages of a topic; None: leave the field out."""

    def change(of: Topic, message: Message) -> Message:
        if of is not topic:
            return message
        return {key: value for key, value in {**message, **fields}.items() if value is not None}

    return change


def by(topic: Topic, edit: Callable[[Message], object]) -> Change:
    """Edit the messages of a topic in place; an edit that returns False loses the message."""

    def change(of: Topic, message: Message) -> Message | None:
        return None if of is topic and edit(message) is False else message

    return change


def without_errors(state: Message) -> None:
    state["errors"] = []


def all_finished(state: Message) -> None:
    for each in (*state["actionStates"], *state.get("instantActionStates", ())):
        each["actionStatus"] = "FINISHED"


def never_ending(state: Message) -> None:
    for each in (*state["actionStates"], *state.get("instantActionStates", ())):
        each["actionStatus"] = "RUNNING"


def but(*names: str) -> Callable[[Message], bool]:
    """Return an edit of instant actions that loses these."""
    return lambda message: bool(message["actions"][0]["actionType"] not in names)


def drops_action(name: str) -> Callable[[Message], None]:
    def edit(factsheet: Message) -> None:
        features = factsheet["protocolFeatures"]
        features["agvActions"] = [each for each in features["agvActions"] if each["actionType"] != name]

    return edit


def backwards(state: Message) -> None:
    state["timestamp"] = f"2026-11-29T12:00:{59 - state['headerId'] % 60:02}.000Z"


def without_speed(factsheet: Message) -> None:
    factsheet["physicalParameters"]["speedMax"] = 0.0


def lost(state: Message) -> None:
    if state["nodeStates"]:
        state["nodeStates"][-1]["nodeId"] = "nowhere"


def far_away(state: Message) -> None:
    if not state["nodeStates"]:
        state["agvPosition"]["x"] += 2


def all_released(order: Message) -> None:
    for each in (*order["nodes"], *order["edges"]):
        each["released"] = True


def any_start(order: Message) -> None:
    if order["nodes"]:
        order["nodes"][0].pop("nodePosition", None)


def only_new_orders(order: Message) -> bool:
    return bool(order["orderUpdateId"] == 0)


def one_action_twice(state: Message) -> None:
    action = {"actionId": "twice", "actionType": "beep", "actionStatus": "FINISHED"}
    state["actionStates"] = [action, action]


def two_versions_of_a_map(state: Message) -> None:
    one = {"mapId": state["agvPosition"]["mapId"], "mapStatus": "ENABLED"}
    state["maps"] = [{**one, "mapVersion": version} for version in ("1", "2")]


def sheet(*path: str, **fields: Any) -> dict[str, Any]:
    """Replace fields of an object in the factsheet."""

    def edit(factsheet: Message) -> None:
        part = factsheet
        for name in path:
            part = part[name]
        part.update(fields)

    return {"says": by(FACTSHEET, edit)}


def twice(*path: str) -> dict[str, Any]:
    """List each item of an array in the factsheet twice."""

    def edit(factsheet: Message) -> None:
        part: Any = factsheet
        for name in path:
            part = part[name]
        part.extend(list(part))

    return {"says": by(FACTSHEET, edit)}


def without_scopes(factsheet: Message) -> None:
    factsheet["protocolFeatures"]["agvActions"][0]["actionScopes"] = []


def one_parameter_twice(factsheet: Message) -> None:
    parameter = {"key": "one", "valueDataType": "STRING"}
    factsheet["protocolFeatures"]["agvActions"][0]["actionParameters"] = [parameter, parameter]


def without_references(state: Message) -> None:
    for error in state["errors"]:
        error["errorReferences"] = []


def all_fatal(state: Message) -> None:
    for error in state["errors"]:
        error["errorLevel"] = "FATAL"


def remembering() -> Callable[[Message], None]:
    """Keep all errors for ever."""
    seen: list[Message] = []

    def edit(state: Message) -> None:
        seen.extend(each for each in state["errors"] if each not in seen)
        state["errors"] = list(seen)

    return edit


def only_the_first(message: Message) -> None:
    message["actions"] = message["actions"][:1]


def without_the_last_node(state: Message) -> None:
    state["nodeStates"] = state["nodeStates"][:1]


STATE, CONNECTION, FACTSHEET = Topic.STATE, Topic.CONNECTION, Topic.FACTSHEET
REQUESTED = ("factsheet/request", "factsheet/retained")
"""The clause under test is added to it."""
MUTANTS: dict[str, tuple[str, tuple[str, ...], dict[str, Any]]] = {
    # name: (the clause that must notice, the clauses to run, how the robot differs)
    "connection not retained": ("connection/retained", ("connection/retained",), {"retained": False}),
    "offline": (
        "connection/retained",
        ("connection/retained",),
        {"says": on(CONNECTION, connectionState="OFFLINE")},
    ),
    "states although offline": (
        "conversation/connection",
        ("stateRequest",),
        {"says": on(CONNECTION, connectionState="OFFLINE")},
    ),
    "no position": ("state/position", ("state/position",), {"says": on(STATE, agvPosition=None)}),
    "no operating mode": ("state/message", ("stateRequest",), {"says": on(STATE, operatingMode=None)}),
    "field of its own": ("state/field", ("stateRequest",), {"says": on(STATE, mood="good")}),
    "lower case mode": ("state/message", ("stateRequest",), {"says": on(STATE, operatingMode="automatic")}),
    "local time": (
        "state/spelling",
        ("stateRequest",),
        {"says": on(STATE, timestamp="2026-11-29T12:00:00.000+01:00")},
    ),
    "header of another robot": (
        "state/address",
        ("stateRequest",),
        {"says": on(STATE, serialNumber="other")},
    ),
    "another major version": ("state/message", ("stateRequest",), {"says": on(STATE, version="3.0.0")}),
    "constant headerId": (
        "state/headerId",
        ("stateRequest", "pause/standing"),
        {"says": on(STATE, headerId=7)},
    ),
    "clock that stands": (
        "state/timestamp",
        ("stateRequest", "pause/standing"),
        {"says": by(STATE, backwards)},
    ),
    "factsheet never sent": (
        "factsheet/request",
        ("factsheet/request",),
        {"says": by(FACTSHEET, lambda _: False)},
    ),
    "factsheet without speeds": (
        "factsheet/speeds",
        ("factsheet/request", "factsheet/speeds"),
        {"says": by(FACTSHEET, without_speed)},
    ),
    "factsheet without cancelOrder": (
        "factsheet/actions",
        ("factsheet/request", "factsheet/actions"),
        {"says": by(FACTSHEET, drops_action("cancelOrder"))},
    ),
    "malformed factsheet": (
        "factsheet/message",
        ("factsheet/request",),
        {"says": on(FACTSHEET, typeSpecification=None)},
    ),
    "deaf to instant actions": (
        "stateRequest",
        ("stateRequest",),
        {"hears": by(Topic.INSTANT_ACTIONS, lambda _: False)},
    ),
    "no state of instant actions": ("stateRequest", ("stateRequest",), {"says": on(STATE, actionStates=[])}),
    "actions that never end": ("pause/standing", ("pause/standing",), {"says": by(STATE, never_ending)}),
    "pause that does not show": ("pause/standing", ("pause/standing",), {"says": on(STATE, paused=False)}),
    "unknown action finished": (
        "instantAction/unknown",
        ("instantAction/unknown",),
        {"says": by(STATE, all_finished)},
    ),
    "no error about unknown action": (
        "instantAction/unknown",
        ("instantAction/unknown",),
        {"says": by(STATE, without_errors)},
    ),
    "cancel without an order finished": (
        "cancelOrder/idle",
        ("cancelOrder/idle",),
        {"says": by(STATE, all_finished)},
    ),
    "deaf to orders": ("order/accept", ("order/accept",), {"hears": by(Topic.ORDER, lambda _: False)}),
    "order not echoed": ("order/accept", ("order/accept",), {"says": on(STATE, orderId="")}),
    "no error about an order without nodes": (
        "order/noNodes",
        ("order/noNodes",),
        {"says": by(STATE, without_errors)},
    ),
    "no error about a missing edge": (
        "order/missingEdge",
        ("order/missingEdge",),
        {"says": by(STATE, without_errors)},
    ),
    "no error about sequence IDs": (
        "order/sequence",
        ("order/sequence",),
        {"says": by(STATE, without_errors)},
    ),
    "takes orders from afar": ("order/startFar", ("order/startFar",), {"hears": by(Topic.ORDER, any_start)}),
    "no error about an unknown map": (
        "order/unknownMap",
        ("order/unknownMap",),
        {"says": by(STATE, without_errors)},
    ),
    "no error about an unknown action": (
        "order/unknownAction",
        ("order/unknownAction",),
        {"says": by(STATE, without_errors)},
    ),
    "deaf to updates": ("drive/horizon", ("drive/horizon",), {"hears": by(Topic.ORDER, only_new_orders)}),
    "drives its horizon": ("drive/horizon", ("drive/horizon",), {"hears": by(Topic.ORDER, all_released)}),
    "never says driving": ("drive", ("drive",), {"says": on(STATE, driving=False)}),
    "arrives elsewhere": ("drive", ("drive",), {"says": by(STATE, far_away)}),
    "reports nodes of no order": ("conversation/progress", ("drive",), {"says": by(STATE, lost)}),
    "ignores cancelOrder": (
        "cancelOrder",
        ("cancelOrder",),
        {"hears": by(Topic.INSTANT_ACTIONS, but("cancelOrder"))},
    ),
    "ignores startPause": (
        "pause/driving",
        ("pause/driving",),
        {"hears": by(Topic.INSTANT_ACTIONS, but("startPause"))},
    ),
    "no error about another order": ("order/other", ("order/other",), {"says": by(STATE, without_errors)}),
    "no error about a wrong stitch": (
        "update/stitch",
        ("update/stitch",),
        {"says": by(STATE, without_errors)},
    ),
    "no error about an outdated update": (
        "update/outdated",
        ("update/outdated",),
        {"says": by(STATE, without_errors)},
    ),
    "map not enabled": (
        "state/map",
        ("state/map",),
        {"says": on(STATE, maps=[{"mapId": "other", "mapVersion": "1", "mapStatus": "ENABLED"}])},
    ),
    "two versions of a map": ("state/maps", ("state/maps",), {"says": by(STATE, two_versions_of_a_map)}),
    "nodes without an order": (
        "state/idle",
        ("state/idle",),
        {"says": on(STATE, orderId="", nodeStates=[{"nodeId": "n", "sequenceId": 2, "released": True}])},
    ),
    "velocity at rest": ("state/standing", ("state/standing",), {"says": on(STATE, velocity={"vx": 1.0})}),
    "one action twice": ("state/actionIds", ("state/actionIds",), {"says": by(STATE, one_action_twice)}),
    "odd numbers of nodes": (
        "state/sequenceIds",
        ("state/sequenceIds",),
        {"says": on(STATE, nodeStates=[{"nodeId": "n", "sequenceId": 3, "released": True}])},
    ),
    "number of no node": (
        "state/lastNode",
        ("state/lastNode",),
        {"says": on(STATE, lastNodeId="", lastNodeSequenceId=4)},
    ),
    "base requested without a horizon": (
        "state/newBaseRequest",
        ("state/newBaseRequest",),
        {"says": on(STATE, newBaseRequest=True)},
    ),
    "error without a type": (
        "state/errorTypes",
        ("state/errorTypes",),
        {"says": on(STATE, errors=[{"errorType": "", "errorLevel": "WARNING"}])},
    ),
    "no width": ("factsheet/sizes", REQUESTED, sheet("physicalParameters", width=0.0)),
    "heights swapped": ("factsheet/heights", REQUESTED, sheet("physicalParameters", heightMin=9.0)),
    "no brakes": ("factsheet/accelerations", REQUESTED, sheet("physicalParameters", decelerationMax=0.0)),
    "no series": ("factsheet/kind", REQUESTED, sheet("typeSpecification", seriesName="")),
    "no localization": (
        "factsheet/localization",
        REQUESTED,
        sheet("typeSpecification", localizationTypes=[]),
    ),
    "no navigation": ("factsheet/navigation", REQUESTED, sheet("typeSpecification", navigationTypes=[])),
    "rare states": (
        "factsheet/intervals",
        REQUESTED,
        sheet("protocolLimits", "timing", minStateInterval=60.0, defaultStateInterval=60.0),
    ),
    "intervals swapped": (
        "factsheet/stateIntervals",
        REQUESTED,
        sheet("protocolLimits", "timing", minStateInterval=20.0, defaultStateInterval=10.0),
    ),
    "orders of one node": (
        "factsheet/orderLength",
        REQUESTED,
        sheet("protocolLimits", "maxArrayLens", **{"order.nodes": 1}),
    ),
    "states shorter than orders": (
        "factsheet/stateLength",
        REQUESTED,
        sheet("protocolLimits", "maxArrayLens", **{"order.nodes": 50, "state.nodeStates": 10}),
    ),
    "actions described twice": (
        "factsheet/uniqueActions",
        REQUESTED,
        twice("protocolFeatures", "agvActions"),
    ),
    "action without a scope": ("factsheet/scopes", REQUESTED, {"says": by(FACTSHEET, without_scopes)}),
    "parameter described twice": (
        "factsheet/parameters",
        REQUESTED,
        {"says": by(FACTSHEET, one_parameter_twice)},
    ),
    "fields listed twice": ("factsheet/fields", REQUESTED, twice("protocolFeatures", "optionalParameters")),
    "unknown load positions": (
        "factsheet/loads",
        REQUESTED,
        sheet(
            "loadSpecification",
            loadPositions=["top"],
            loadSets=[{"setName": "s", "loadType": "t", "loadPositions": ["x"]}],
        ),
    ),
    "errors without references": (
        "errors/references",
        ("errors/references",),
        {"says": by(STATE, without_references)},
    ),
    "refusals are fatal": ("errors/level", ("errors/level",), {"says": by(STATE, all_fatal)}),
    "errors for ever": ("errors/cleared", ("errors/cleared",), {"says": by(STATE, remembering())}),
    "one instant action of two": (
        "instantAction/two",
        ("instantAction/two",),
        {"hears": by(Topic.INSTANT_ACTIONS, only_the_first)},
    ),
    "no error about an update after the cancel": (
        "update/afterCancel",
        ("update/afterCancel",),
        {"says": by(STATE, without_errors)},
    ),
    "order shown in parts": (
        "order/states",
        ("order/states",),
        {"says": by(STATE, without_the_last_node)},
    ),
    **{
        f"no error about order/{id_}": (
            f"order/{id_}",
            (f"order/{id_}",),
            {"says": by(STATE, without_errors)},
        )
        for id_ in ("gap", "hole", "sameActions", "noNodeId", "text", "edgeAction")
    },
    "no visualizations": (
        "visualization",
        ("visualization",),
        {"says": by(Topic.VISUALIZATION, lambda _: False)},
    ),
}


@pytest.mark.parametrize("name", MUTANTS)
async def test_fault_is_caught_by_its_clause(agent: tuple[Broker, str], name: str) -> None:
    caught, clauses, changes = MUTANTS[name]
    clauses = (*clauses, caught) if clauses == REQUESTED else clauses
    verdicts = await judged(agent, clauses, **changes)
    assert verdicts[caught].outcome is Outcome.FAILED, {
        id_: (each.outcome, each.reason)
        for id_, each in verdicts.items()
        if each.outcome is not Outcome.PASSED
    }
    assert verdicts[caught].reason


NOISE: dict[str, Change] = {
    "headerId counts from 0 again": by(STATE, lambda state: state.update(headerId=state["headerId"] % 5)),
    "other order of fields": lambda _topic, message: dict(reversed(message.items())),
    "decimals": by(STATE, lambda state: state.update(distanceSinceLastNode=0.123456789)),
}


@pytest.mark.parametrize("name", NOISE)
async def test_what_the_standard_allows_changes_no_verdict(agent: tuple[Broker, str], name: str) -> None:
    verdicts = await judged(agent, ("stateRequest", "order/accept", "drive"), says=NOISE[name])
    assert report.violations(list(verdicts.values())) == []


async def test_without_a_plan_the_robot_is_not_moved(agent: tuple[Broker, str]) -> None:
    seen: list[str] = []
    watch = by(Topic.ORDER, lambda order: seen.append(order["orderId"]))
    verdicts = await judged(agent, ("order/noNodes", "drive", "cancelOrder"), plan=False, hears=watch)
    assert len(seen) == 1
    assert verdicts["drive"].outcome is verdicts["cancelOrder"].outcome is Outcome.NOT_APPLICABLE
    assert "--place x,y" in verdicts["drive"].reason


PERSON = ("person/emergencyStop", "person/manual", "person/automatic", "person/link")
STEPS: dict[str, tuple[Topic, Message]] = {
    "press": (STATE, {"safetyState": {"eStop": "MANUAL", "fieldViolation": False}}),
    "release": (STATE, {}),
    "MANUAL": (STATE, {"operatingMode": "MANUAL"}),
    "AUTOMATIC": (STATE, {}),
    "cut": (CONNECTION, {"connectionState": "CONNECTIONBROKEN"}),
    "restore": (CONNECTION, {}),
}
"""What a person does, and what changes in the robot's messages then."""


async def tried_by_a_person(agent: tuple[Broker, str], *ignored: str) -> dict[str, Verdict]:
    """Judge an agent at which a person does what is asked for; it shows all but what is ``ignored``."""
    broker, interface = agent
    shown: dict[Topic, Message] = {STATE: {}, CONNECTION: {}}
    last: dict[Topic, Message] = {}
    client = MqttPeer(broker)

    def says(topic: Topic, message: Message) -> Message:
        last[topic] = message
        return {**message, **shown.get(topic, {})}

    def hears(topic: Topic, message: Message) -> Message:
        # the agent itself is in AUTOMATIC all along
        takes = topic is not Topic.ORDER or "operatingMode" not in shown[STATE]
        return message if takes else {**message, "nodes": []}

    async def person(what: str) -> None:
        step = next(each for each in STEPS if each in what)
        topic, fields = STEPS[step]
        shown[topic] = {} if step in ignored else fields
        await until(lambda: {topic, STATE} <= last.keys(), what="the agent's first messages")
        for each in (topic, STATE):
            name = TopicScheme(interface).of(ROBOT, each)
            client.publish(name, json.dumps(last[each]))

    with client:
        return await judged(agent, PERSON, person=person, says=says, hears=hears)


async def test_what_a_person_does_shows(agent: tuple[Broker, str]) -> None:
    verdicts = await tried_by_a_person(agent)
    assert {id_: verdicts[id_].reason for id_ in PERSON} == dict.fromkeys(PERSON, "")

    nobody = await judged(agent, PERSON)
    assert {nobody[id_].outcome for id_ in PERSON} == {Outcome.NOT_APPLICABLE}


@pytest.mark.parametrize(
    ("ignored", "caught"), [("press", "person/emergencyStop"), ("MANUAL", "person/manual")]
)
async def test_what_a_person_does_and_the_robot_does_not_show_is_caught(
    agent: tuple[Broker, str], ignored: str, caught: str
) -> None:
    verdicts = await tried_by_a_person(agent, ignored)
    assert [id_ for id_ in PERSON if verdicts[id_].outcome is Outcome.FAILED] == [caught]


def nena(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "nena_cli", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=4 * PATIENCE, check=False)


@pytest.mark.parametrize(
    "version", [*(pytest.param(each, marks=pytest.mark.long) for each in ("2.0.0", "2.1.0")), "3.0.0"]
)
def test_honest_robot_passes_all_clauses_and_the_reports_say_so(
    broker: Broker, interface_name: str, tmp_path: Path, version: str
) -> None:
    options = ("--version", version, "--loopback.x", "1", "--loopback.y", "1", "--loopback.speed", "2")
    reports = {kind: tmp_path / f"report.{kind}" for kind in ("json", "junit", "html")}
    with AgentProcess(broker, interface_name, tmp_path / "journal", *options):
        done = nena(
            *("vda5050", "test", "robot", f"mqtt://{broker.host}:{broker.port}", str(ROBOT)),
            *(
                "--version",
                version,
                "--interface",
                interface_name,
                "--square",
                "4",
                "--yes",
                "--action",
                "pick",
            ),
            *(text for kind, path in reports.items() for text in (f"--{kind}", str(path))),
            *("--recording", str(tmp_path / "messages.jsonl")),
        )
    assert done.returncode == 0, done.stdout
    clauses = json.loads(reports["json"].read_bytes())["clauses"]
    # the loopback driver has one map, from its settings
    apart = {each["id"]: each["reason"] for each in clauses if each["outcome"] != "passed"}
    assert set(apart) == {"enableMap/unknown", "deleteMap/unknown", *PERSON}, apart
    assert len(clauses) >= 120
    suite = ElementTree.fromstring(reports["junit"].read_bytes())
    assert (suite.get("tests"), suite.get("failures")) == (str(len(clauses)), "0")
    page = reports["html"].read_text(encoding="utf-8")
    assert "order/accept" in page
    assert "http" not in page
    assert nena("vda5050", "check", str(tmp_path / "messages.jsonl")).returncode in (0, 1)


async def test_a_robot_is_looked_for_before_it_is_judged(
    agent: tuple[Broker, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    broker, interface = agent
    codec = codec_named(VERSION)
    address = BrokerAddress(MqttSettings(host=broker.host, port=broker.port), ())
    topics = topics_for(VERSION, interface)
    there = await first_state(address, RobotUnderTest(ROBOT, topics, codec, ()), "test-there")
    assert there is not None
    assert there.version == VERSION
    monkeypatch.setattr(run, "FIRST_STATE_WITHIN", 0.5)
    absent = RobotUnderTest(RobotKey("ACME", "absent"), topics, codec, ())
    assert await first_state(address, absent, "test-absent") is None


async def test_no_action_is_done_that_nobody_has_named(agent: tuple[Broker, str]) -> None:
    verdicts = await judged(agent, ("order/action",), action="")
    assert verdicts["order/action"].outcome is Outcome.NOT_APPLICABLE
