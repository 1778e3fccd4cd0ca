"""The conformance kit for fleet controls: honest ones pass, and each fault is caught by its clause."""

from __future__ import annotations

import asyncio
import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from time import monotonic
from uuid import uuid4

import pytest
from defusedxml import ElementTree

from nena_conversations.broker import BrokerAddress
from nena_conversations.kit.clause import Outcome, Verdict
from nena_conversations.kit.fleet_clauses import FLEET_CLAUSES
from nena_conversations.kit.fleet_run import PlayedSetup, judge_fleet
from nena_conversations.kit.played_robot import PlayedRobot
from nena_conversations.recording import read_file
from nena_shared.settings import MqttSettings
from nena_shared.vda5050.state import OperatingMode, State
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.versions import codec_for
from support.broker import Broker
from support.order_service_fleet import Fleet, listening, running
from support.small_fleet import Kind, Message, SmallFleet, running_fleet
from support.waiting import PATIENCE

pytestmark = pytest.mark.broker

PATIENT = 10.0
"""Seconds for an order to come, where it certainly comes."""
OFTEN, MANY = 0.03, 10
"""Seconds between two messages of a fleet control that repeats without end, or messages at once."""
WATCH = 0.4
"""Seconds for which the kit watches that something does not come."""
LONG_WATCH = 2.0
"""The same where it does come: the watch ends then, so only a busy machine needs all of it."""


async def judged(
    broker: Broker,
    clauses: tuple[str, ...] | None,
    kind: Kind = SmallFleet,
    version: str = "3.0.0",
    *,
    answer_within: float = PATIENT,
    watch: float = WATCH,
    order_interval: float = 0.0,
) -> dict[str, Verdict]:
    """Judge a small fleet control by some of the clauses, and by what the checker sees."""
    codec = codec_for(version)
    chosen = [clause for clause in FLEET_CLAUSES if clauses is None or clause.id in clauses]
    assert clauses is None or len(chosen) == len(clauses)
    address = BrokerAddress(MqttSettings(host=broker.host, port=broker.port), ())
    topics = TopicScheme(f"fleet{uuid4().hex[:6]}", codec.major_version)
    robot, place = RobotKey("ACME", topics.interface_name), (1.0, 2.0, 0.0)
    setup = PlayedSetup(robot, codec, topics, place, "hall", ("beep",), order_interval)
    async with running_fleet(address, topics, codec, setup.robot, kind) as fleet:
        verdicts, _ = await judge_fleet(
            address,
            [setup],
            fleet.ask,
            clauses=chosen,
            report=lambda _: None,
            client_id=f"test-{topics.interface_name}",
            answer_within=answer_within,
            watch=watch,
            pace=0.02,
        )
    return {verdict.id: verdict for verdict in verdicts}


def failed(verdicts: dict[str, Verdict]) -> dict[str, str]:
    return {id_: each.reason for id_, each in verdicts.items() if each.outcome is Outcome.FAILED}


async def test_an_honest_fleet_control_passes_all_clauses_in_each_version(broker: Broker) -> None:
    versions = ("2.0.0", "2.1.0", "3.0.0", "3.0.1")
    results = await asyncio.gather(*(judged(broker, None, version=version) for version in versions))

    for verdicts in results:
        assert failed(verdicts) == {}
        passed = [each for each in verdicts.values() if each.outcome is Outcome.PASSED]
        assert len(passed) >= 65, {
            each.id: each.reason for each in verdicts.values() if each.outcome is not Outcome.PASSED
        }


async def test_a_broker_that_holds_messages_back_fails_no_clause(
    own_broker: Broker, monkeypatch: pytest.MonkeyPatch
) -> None:
    set_mode = PlayedRobot.set_mode

    def held_back(player: PlayedRobot, mode: OperatingMode) -> None:
        own_broker.freeze()
        asyncio.get_running_loop().call_later(2 * WATCH, own_broker.thaw)
        set_mode(player, mode)

    monkeypatch.setattr(PlayedRobot, "set_mode", held_back)
    assert failed(await judged(own_broker, ("mode/manual", "mode/service", "mode/automatic"))) == {}


def writing(topic: Topic, edit: Callable[[Message], object]) -> type[SmallFleet]:
    """Return a fleet control that edits the messages of a topic; an edit that returns False loses one."""

    class Writing(SmallFleet):
        def write(self, of: Topic, message: Message) -> None:
            if of is not topic or edit(message) is not False:
                super().write(of, message)

    return Writing


def with_order(edit: Callable[[Message], object]) -> type[SmallFleet]:
    return writing(Topic.ORDER, edit)


def with_actions(edit: Callable[[Message], object]) -> type[SmallFleet]:
    return writing(Topic.INSTANT_ACTIONS, edit)


def is_new(order: Message) -> bool:
    return bool(order["orderUpdateId"] == 0)


def numbered_from_2(order: Message) -> None:
    for each in (*order["nodes"], *order["edges"]):
        each["sequenceId"] += 2


def gaps(order: Message) -> None:
    order["nodes"][-1]["sequenceId"] += 2


def odd_nodes(order: Message) -> None:
    for each in (*order["nodes"], *order["edges"]):
        each["sequenceId"] += 1


def holes_in_the_base(order: Message) -> None:
    if is_new(order):
        order["nodes"][1]["released"] = False


def elsewhere(order: Message) -> None:
    if is_new(order):
        order["nodes"][0]["nodePosition"]["x"] += 50
        order["nodes"][0]["nodeId"] = "elsewhere"


def moved_stitch(order: Message) -> None:
    if not is_new(order):
        order["nodes"][0]["nodePosition"]["x"] += 0.5


def other_stitch(order: Message) -> None:
    if not is_new(order):
        order["nodes"][0]["nodeId"] = "other"


def backwards(order: Message) -> None:
    order["timestamp"] = f"2026-11-29T12:00:{59 - order['headerId'] % 60:02}.000Z"


def same_actions(order: Message) -> None:
    for node in order["nodes"]:
        for action in node["actions"]:
            action["actionId"] = "always"


def dancing(order: Message) -> None:
    for node in order["nodes"]:
        for action in node["actions"]:
            action["actionType"] = "dance"


class AtOnce(SmallFleet):
    """Orders whatever the robot's state is."""

    def may_order(self, _state: State) -> bool:
        return self.reachable()


class AnyMode(SmallFleet):
    def may_order(self, state: State) -> bool:
        return self.reachable() and not state.node_states


class AnyConnection(SmallFleet):
    def reachable(self) -> bool:
        return True


class Impatient(SmallFleet):
    """Sends another order if the robot does not answer at once."""

    def repeat(self) -> None:
        self.order, self.wanted = None, True


class Changing(SmallFleet):
    """Repeats an order with another content."""

    def repeat(self) -> None:
        assert self.order
        self.order["nodes"][-1]["nodePosition"]["x"] += 1
        super().repeat()


class Stubborn(SmallFleet):
    """Sends a refused order again and again."""

    def is_refused(self, state: State) -> bool:
        assert self.order
        if super().is_refused(state):
            for _ in range(MANY):
                self.send_order(self.order)
        return False


class Eager(SmallFleet):
    """Sends a refused update again and again."""

    def on_refused_update(self) -> None:
        assert self.order
        for _ in range(MANY):
            self.send_order(self.order)


class Repeating(SmallFleet):
    """Sends an order again although the robot has confirmed it."""

    def go_on(self, state: State) -> None:
        super().go_on(state)
        waits = self.confirmed and state.order_update_id == 0 and monotonic() - self.sent_at > OFTEN
        if self.order and self.order["orderUpdateId"] == 0 and waits:
            self.send_order(self.order)


class Forgetful(SmallFleet):
    """Never sends a lost order again."""

    def repeat(self) -> None:
        """Leave it."""


class Reusing(SmallFleet):
    """Uses one orderId for all orders."""

    def linked(self, order: Message) -> Message:
        return super().linked({**order, "orderId": "the-order"})


class Unending(SmallFleet):
    """Never releases the horizon."""

    def extend(self) -> None:
        """Leave it."""


class Replacing(SmallFleet):
    """Sends another order when the robot's link breaks."""

    def reachable(self) -> bool:
        if not super().reachable() and self.order:
            self.order, self.wanted = None, True
        return super().reachable()

    def may_order(self, state: State) -> bool:
        return self.reachable() and state.operating_mode.takes_orders


class Clinging(SmallFleet):
    """Extends an order that the robot has lost."""

    def think(self) -> None:
        state = self.state
        if self.order and self.confirmed and state and state.order_id == "" and self.sendings < 3:
            self.extend()
            self.sendings = 3
        else:
            super().think()


class Uncancelling(SmallFleet):
    """Never cancels."""

    def cancel(self) -> None:
        """Leave it."""


class Hasty(SmallFleet):
    """Does not wait for the end of cancelOrder."""

    def watch_cancel(self, _state: State) -> None:
        self.end()

    def may_order(self, _state: State) -> bool:
        return self.reachable()


class Cancelling(SmallFleet):
    """Sends cancelOrder again after its end."""

    def end(self) -> None:
        if self.cancel_id:
            asyncio.get_running_loop().call_later(LONG_WATCH * 0.75, self.cancel_again)
        super().end()

    def cancel_again(self) -> None:
        self.send(
            Topic.INSTANT_ACTIONS,
            {"actions": [self.action(f"c-{next(self.numbers)}", "cancelOrder", "NONE")]},
        )


class Updating(SmallFleet):
    """Extends an order that it has cancelled."""

    def end(self) -> None:
        order, cancelled = self.order, self.cancel_id
        super().end()
        if order and cancelled:
            stitch, last = order["nodes"][-2:]
            nodes = [stitch, {**last, "released": True}]
            update = self.linked({**order, "orderUpdateId": order["orderUpdateId"] + 1, "nodes": nodes})
            asyncio.get_running_loop().call_later(OFTEN, self.send_order, update)


class Retaining(SmallFleet):
    retain = True


class Careful(SmallFleet):
    qos = 1


ONE, DRIVE, TWO = ("order/positions",), ("order/complete",), ("order/complete", "order/next")
MUTANTS: dict[str, tuple[str, tuple[str, ...], Kind]] = {
    # name: (the only clauses that fail, the clauses to try, the fleet control)
    "no orders at all": ("order/start", ("order/start",), with_order(lambda _: False)),
    "order without nodes": ("order/message", ONE, with_order(lambda order: order.pop("nodes"))),
    "field of its own": ("order/field", ONE, with_order(lambda order: order.update(mood="good"))),
    "local time": (
        "order/spelling",
        ONE,
        with_order(lambda order: order.update(timestamp=f"{order['timestamp'][:-1]}+00:00")),
    ),
    "another major version": ("order/message", ONE, with_order(lambda order: order.update(version="2.1.0"))),
    "header of another robot": (
        "order/address",
        ONE,
        with_order(lambda order: order.update(serialNumber="other")),
    ),
    "constant headerId": ("order/headerId", DRIVE, with_order(lambda order: order.update(headerId=7))),
    "clock that goes back": ("order/timestamp", DRIVE, with_order(backwards)),
    "orders retained": ("order/retained", DRIVE, Retaining),
    "orders with QoS 1": ("order/qos", DRIVE, Careful),
    "missing edge": ("conversation/graph", ONE, with_order(lambda order: order.update(edges=[]))),
    "gap in sequenceIds": ("conversation/sequence", ONE, with_order(gaps)),
    "odd sequenceIds of nodes": ("conversation/sequence", ONE, with_order(odd_nodes)),
    "hole in the base": ("conversation/base", ONE, with_order(holes_in_the_base)),
    "sequenceIds from 2": ("conversation/firstSequenceId", ONE, with_order(numbered_from_2)),
    "updates from 5": (
        "conversation/firstUpdateId",
        ONE,
        with_order(lambda order: order.update(orderUpdateId=order["orderUpdateId"] + 5)),
    ),
    "start elsewhere": ("conversation/startNode", ONE, with_order(elsewhere)),
    "action that is not offered": ("conversation/notOffered", DRIVE, with_order(dancing)),
    "IDs that are too long": (
        "conversation/limits",
        ONE,
        with_order(lambda order: order.update(orderId=order["orderId"] * 60)),
    ),
    "actionId used again": ("conversation/actionId", TWO, with_order(same_actions)),
    "update at another node": ("conversation/stitching", ("order/confirmed",), with_order(other_stitch)),
    "last node of the base changed": ("conversation/stitchingNode", DRIVE, with_order(moved_stitch)),
    "orderId used again": ("order/next conversation/outdatedUpdate", TWO, Reusing),
    "horizon never released": ("order/complete", DRIVE, Unending),
    "confirmed order repeated": ("order/confirmed", ("order/confirmed",), Repeating),
    "lost order forgotten": ("order/lost", ("order/lost",), Forgetful),
    "repeated with changes": ("order/lostSame conversation/sameUpdateId", ("order/lostSame",), Changing),
    "no patience": ("order/slow", ("order/slow",), Impatient),
    "refused order repeated": ("refused/order", ("refused/order",), Stubborn),
    "refused update repeated": ("refused/update", ("refused/update",), Eager),
    "orders in MANUAL": ("mode/manual conversation/mode", ("mode/manual",), AnyMode),
    "orders to OFFLINE": ("connection/offline conversation/offline", ("connection/offline",), AnyConnection),
    "another order at a lost link": (
        "connection/kept conversation/otherOrder",
        ("connection/kept",),
        Replacing,
    ),
    "update of a lost order": ("restart/lost", ("restart/lost",), Clinging),
    "no cancelOrder": ("cancel/sent", ("cancel/sent",), Uncancelling),
    "cancelOrder without end": ("cancel/once", ("cancel/once",), Cancelling),
    "no end of cancelOrder awaited": ("cancel/waits conversation/otherOrder", ("cancel/waits",), Hasty),
    "update after cancelOrder": ("conversation/updateAfterCancel", ("cancel/sent",), Updating),
    "orders in spite of FATAL": ("error/fatal", ("error/fatal",), AtOnce),
    "instant action with a field of its own": (
        "instantActions/field",
        ("cancel/sent",),
        with_actions(lambda message: message.update(mood="good")),
    ),
    "cancelOrder that blocks": (
        "instantActions/spelling",
        ("cancel/sent",),
        with_actions(lambda message: message["actions"][0].update(blockingType="HARD")),
    ),
    "cancelOrder of another order": (
        "cancel/named",
        ("cancel/named",),
        with_actions(lambda message: message["actions"][0]["actionParameters"][0].update(value="other")),
    ),
}


SILENT = ("order/start", "order/message", "order/complete", "order/lost", "cancel/sent", "connection/kept")


def within(name: str) -> float:
    """Return how long an order may take: not long where the fault is that nothing comes."""
    caught, *_ = MUTANTS[name][0].split()
    return 2.0 if caught in SILENT or caught.startswith("conversation/") else PATIENT


BATCHES = 4


@pytest.mark.parametrize("batch", range(BATCHES))
async def test_each_fault_is_caught_by_its_clauses_alone(broker: Broker, batch: int) -> None:
    """Several at once: most of the time is waiting for what does not come."""
    names = list(MUTANTS)[batch::BATCHES]
    tests = (
        judged(broker, MUTANTS[name][1], MUTANTS[name][2], answer_within=within(name), watch=LONG_WATCH)
        for name in names
    )
    found = dict(zip(names, map(failed, await asyncio.gather(*tests)), strict=True))

    assert {name: set(each) for name, each in found.items()} == {
        name: set(MUTANTS[name][0].split()) for name in names
    }, found
    assert all(reason for each in found.values() for reason in each.values())


async def test_orders_faster_than_the_factsheet_allows_are_caught(broker: Broker) -> None:
    found = failed(await judged(broker, DRIVE, order_interval=2.0))
    assert set(found) == {"conversation/orderInterval"}


NOISE: dict[str, Kind] = {
    "headerId counts from 0 again": with_order(lambda order: order.update(headerId=order["headerId"] % 2)),
    "other order of fields": with_order(
        lambda order: [order.update({key: order.pop(key)}) for key in sorted(order)]
    ),
    "more decimals": with_order(
        lambda order: [node["nodePosition"].update(theta=0.123456789) for node in order["nodes"]]
    ),
    "fewer decimals": with_order(
        lambda order: order.update(timestamp=f"{order['timestamp'][:-5]}.{order['headerId'] % 10}Z")
    ),
}


async def test_what_the_standard_allows_changes_no_verdict(broker: Broker) -> None:
    found = await asyncio.gather(*(judged(broker, DRIVE, kind) for kind in NOISE.values()))
    assert dict(zip(NOISE, map(failed, found), strict=True)) == {name: {} for name in NOISE}


class Late(SmallFleet):
    """Its last repeat of an order is delivered after the robot has done it."""

    last: Message | None = None

    def begin(self, state: State) -> None:
        if self.last:
            self.send_order(self.last)
        super().begin(state)

    def send_order(self, order: Message) -> None:
        self.last = order
        super().send_order(order)


async def test_a_late_repeat_is_no_other_order(broker: Broker) -> None:
    assert failed(await judged(broker, ("order/lost", "order/lostSame", "order/slow"), Late)) == {}


COMMAND = """
import json, os, sys
from urllib.request import Request, urlopen

def call(method, path, body=None):
    data = None if body is None else json.dumps(body).encode()
    request = Request(sys.argv[1] + path, data, {"Content-Type": "application/json"}, method=method)
    with urlopen(request) as answer:
        return json.load(answer)

vehicle, wanted = os.environ["ROBOT"].split("/")[1].capitalize(), os.environ["WANTED"]
orders = call("GET", "/v1/transportOrders?limit=1000")["transportOrders"]
if wanted == "order":
    place = ["North 3", "South 4"][len(orders) % 2]
    stops = [{"locationName": place, "operation": "MOVE"}]
    call("POST", "/v1/transportOrders", {"intendedVehicle": vehicle, "destinations": stops})
elif wanted == "cancel":
    for order in orders:
        if not order["finished"] and order["intendedVehicle"] == vehicle:
            call("POST", f"/v1/transportOrders/{order['name']}/withdrawal")
else:
    level = {"integrationLevel": "TO_BE_UTILIZED"}
    call("PUT", f"/v1/vehicles/{vehicle}/integrationLevel", level)
"""


SOME = (
    "order/start",
    "order/lost",
    "mode/manual",
    "connection/kept",
    "restart/lost",
    "cancel/sent",
)


@pytest.mark.parametrize(
    ("robots", "clauses"),
    [
        pytest.param(("NeNa/robot-01@2.1.0:3,2", "NeNa/robot-02@3.0.0:3,12"), SOME, id="some clauses"),
        pytest.param(
            ("NeNa/robot-01@2.0.0:3,2", "NeNa/robot-02@3.0.1:3,12"), (), id="all", marks=pytest.mark.long
        ),
        pytest.param(
            ("NeNa/robot-01@2.1.0:3,2", "NeNa/robot-02@3.0.0:3,12"), (), id="all", marks=pytest.mark.long
        ),
    ],
)
async def test_the_order_service_passes_all_clauses_and_the_reports_say_so(
    broker: Broker, tmp_path: Path, robots: tuple[str, ...], clauses: tuple[str, ...]
) -> None:
    fleet = Fleet(broker, f"kit{uuid4().hex[:6]}", tmp_path)
    script = tmp_path / "command.py"
    script.write_text(COMMAND)
    reports = {kind: tmp_path / f"report.{kind}" for kind in ("json", "junit", "html", "badge", "recording")}
    async with running(fleet.settings(fleet={"qos": 0})) as client:
        await listening(client)
        arguments = [
            *("vda5050", "test", "fleet", f"mqtt://{broker.host}:{broker.port}", *robots),
            *("--interface", fleet.interface, "--map", "sample-hall", "--order-interval", "0"),
            *("--watch", "1.0", "--pace", "0.05", "--answer-within", str(PATIENT)),
            *(text for clause in clauses for text in ("--clause", clause)),
            *("--command", f"{sys.executable} {script} {client.base_url}"),
            *(text for kind, path in reports.items() for text in (f"--{kind}", str(path))),
        ]
        nena = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "nena_cli", *arguments, stdout=asyncio.subprocess.PIPE
        )
        output, _ = await asyncio.wait_for(nena.communicate(), 6 * PATIENCE)

    results = json.loads(reports["json"].read_bytes())["clauses"]
    found = {each["id"]: each["reason"] for each in results if each["outcome"] != "passed"}
    # it uses no zones here
    assert not [each for each in found if not re.search("zoneSet|response", each)], found
    assert nena.returncode == 0, output.decode()
    assert len(results) >= (30 + (len(clauses) or len(FLEET_CLAUSES))) * len(robots)
    suite = ElementTree.fromstring(reports["junit"].read_bytes())
    assert (suite.get("tests"), suite.get("failures")) == (str(len(results)), "0")
    badge = ElementTree.fromstring(reports["badge"].read_bytes())
    passed = sum(each["outcome"] == "passed" for each in results)
    assert "".join(badge.itertext()) == f"VDA 5050 2.1.0, 3.0.0{passed} passed" or not clauses
    page = reports["html"].read_text(encoding="utf-8")
    assert "fleet control" in page
    assert "order/start" in page
    assert "http" not in page
    assert len(list(read_file(reports["recording"]))) > 100
