"""Fleet control and a robot over a real broker."""

from __future__ import annotations

import json
import socket
from collections.abc import AsyncIterator

import pytest
from structlog.testing import capture_logs

from nena_conversations.kit.honest_robot import ROBOT, HonestRobot
from nena_order_service.fleet.outputs import VdaOrderFailed
from nena_order_service.fleet.robot import LinkStatus
from nena_order_service.fleet.settings import FleetSettings
from nena_shared.mqtt import Inbound
from nena_shared.plant import Vehicle
from nena_shared.plant.fleet_checks import KEY_LENGTH
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.versions import codec_for
from support.broker import Broker, MqttPeer
from support.fleet import make_vda_order
from support.schemas import schema_problems
from support.waiting import until
from support.wired_robot import PATIENT, QUICK, WiredFleet, WiredRobot

pytestmark = pytest.mark.broker


@pytest.fixture
async def robot(broker: Broker, interface_name: str) -> AsyncIterator[WiredRobot]:
    async with WiredRobot(broker, interface_name).connected() as wired:
        yield wired


@pytest.fixture
async def hasty_fleet(broker: Broker, interface_name: str) -> AsyncIterator[WiredFleet]:
    async with WiredFleet(broker, interface_name, QUICK).connected() as wired:
        yield wired


async def cancel_sent(peer: MqttPeer) -> Inbound:
    """Return the message with cancelOrder; a robot that connects may be asked for its state before."""
    topic = "+/+/+/+/instantActions"
    return await until(
        lambda: next((each for each in peer.received(topic) if b"cancelOrder" in each.payload), None),
        what="cancelOrder",
    )


async def free(fleet: WiredFleet, robot: RobotKey = ROBOT) -> None:
    await until(lambda: fleet.fleet.view(robot).availability.can_take_order, what="a free robot")


@pytest.mark.clause("6.6.2/fleet", "6.1.2/confirm")
async def test_a_vda_order_is_executed_to_its_end(fleet: WiredFleet, robot: WiredRobot) -> None:
    await free(fleet)
    fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B", operation="pick"))
    await fleet.wait_for("VdaOrderAccepted")
    for _ in range(3):
        robot.step()
    await fleet.wait_for("VdaOrderFinished")
    assert robot.received["m"] == 1
    assert fleet.story() == [
        "VdaOrderAccepted",
        "NodePassed",
        "NodePassed",
        "OperationStarted",
        "VdaOrderFinished",
    ]


@pytest.mark.clause("7.2", "4.1/retain", "6.1.2/A2", "7.2/headerId")
async def test_sent_messages_conform_to_the_standard(
    fleet: WiredFleet, robot: WiredRobot, broker: Broker, interface_name: str
) -> None:
    await free(fleet)
    assert robot.robot.key == ROBOT
    with MqttPeer(
        broker, f"{interface_name}/v2/+/+/order", f"{interface_name}/v2/+/+/instantActions"
    ) as peer:
        fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B", operation="pick"))
        first = await peer.wait_for(f"{interface_name}/v2/Honest/robot-1/order")
        fleet.fleet.cancel_vda_order(ROBOT)
        second = await cancel_sent(peer)
    order, cancel = json.loads(first.payload), json.loads(second.payload)
    assert not first.retained
    assert (order["version"], order["manufacturer"], order["serialNumber"]) == ("2.1.0", "Honest", "robot-1")
    assert (order["orderId"], order["orderUpdateId"], order["headerId"]) == ("m", 0, 0)
    assert order["edges"][0]["startNodeId"] == "A"
    assert [each["actionType"] for each in cancel["actions"]] == ["cancelOrder"]
    assert cancel["headerId"] in (0, 1), "the first one, or the one after stateRequest"


@pytest.mark.clause("6.1.2/confirm", "7.2/headerId")
async def test_an_order_is_resent_with_new_headers_until_acknowledged(
    broker: Broker, interface_name: str, robot: WiredRobot
) -> None:
    stubborn = FleetSettings(tick_interval=0.02, resend_after=0.1, resend_at_most_after=0.4, sendings=1000)
    async with WiredFleet(broker, interface_name, stubborn).connected() as fleet:
        robot.report()
        await free(fleet)
        robot.deaf = True
        fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B"))
        await until(lambda: robot.received["m"] >= 3, what="the third sending")
        robot.deaf = False
        await fleet.wait_for("VdaOrderAccepted")
        robot.step()
        await fleet.wait_for("VdaOrderFinished")
    assert robot.headers == list(range(len(robot.headers)))
    assert robot.robot.accepted == ["m"]


@pytest.mark.clause("6.1.2/confirm")
async def test_an_order_that_is_never_acknowledged_fails(hasty_fleet: WiredFleet, robot: WiredRobot) -> None:
    fleet = hasty_fleet
    robot.report()
    await free(fleet)
    robot.deaf = True
    fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B"))
    failed = await fleet.wait_for("VdaOrderFailed")
    assert isinstance(failed, VdaOrderFailed)
    assert str(failed.reason) == "the order was sent 5 times, but the robot never accepted it"
    await until(lambda: robot.received["m"] == 5, what="each sending at the robot")


@pytest.mark.clause("6.1.4/fleet")
async def test_a_refused_order_fails_with_the_robots_words(broker: Broker, interface_name: str) -> None:
    far = HonestRobot(position=(50.0, 0.0, 0.0))
    async with (
        WiredFleet(broker, interface_name).connected() as fleet,
        WiredRobot(broker, interface_name, far).connected(),
    ):
        await free(fleet)
        fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B"))
        failed = await fleet.wait_for("VdaOrderFailed")
    assert isinstance(failed, VdaOrderFailed)
    assert failed.details == ("noRouteError: no",)


@pytest.mark.clause("6.1.3/fleet")
async def test_a_cancelled_vda_order_is_cancelled_at_the_robot(fleet: WiredFleet, robot: WiredRobot) -> None:
    await free(fleet)
    fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B"))
    await fleet.wait_for("VdaOrderAccepted")
    fleet.fleet.cancel_vda_order(ROBOT)
    await fleet.wait_for("VdaOrderCancelled")
    assert robot.robot.idle
    assert (robot.received["m"], robot.received["cancelOrder"]) == (1, 1)


@pytest.mark.clause("6.5/fleet")
async def test_the_last_will_and_silence_are_distinguished(
    hasty_fleet: WiredFleet, broker: Broker, interface_name: str
) -> None:
    fleet = hasty_fleet
    wired = WiredRobot(broker, interface_name)
    async with wired.connected():
        await free(fleet)
        await until(lambda: fleet.fleet.view(ROBOT).link is LinkStatus.SILENT, what="silence")
        wired.report()
        await free(fleet)
        wired.link._settings = wired.link._settings.model_copy(update={"reconnect_min": 60.0})
        session = wired.link._session
        assert session is not None
        assert session.client.socket is not None
        session.client.socket.shutdown(socket.SHUT_RDWR)  # a cut cable
        await until(
            lambda: fleet.fleet.view(ROBOT).link is LinkStatus.CONNECTION_BROKEN, what="the last will"
        )


@pytest.mark.clause("7.1/malformed")
async def test_malformed_messages_are_counted_until_the_next_readable_state_counts(
    fleet: WiredFleet, robot: WiredRobot
) -> None:
    await free(fleet)
    for topic in (Topic.STATE, Topic.CONNECTION, Topic.FACTSHEET):
        robot.say(topic, b'{"headerId": "one"')
    robot.say(Topic.STATE, b"{}")
    await until(lambda: sum(fleet.fleet.statistics.malformed.values()) == 4, what="four malformed messages")
    assert (fleet.fleet.view(ROBOT).link, fleet.fleet.view(ROBOT).malformed) == (LinkStatus.UNREADABLE, 4)
    robot.report()
    await free(fleet)
    fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A"))
    await fleet.wait_for("VdaOrderFinished")


async def test_the_number_of_known_robots_is_limited(broker: Broker, interface_name: str) -> None:
    settings = PATIENT.model_copy(update={"robots_limit": 1})
    one_too_many = HonestRobot(key=RobotKey("Honest", "robot-2"))
    async with (
        WiredFleet(broker, interface_name, settings).connected() as fleet,
        WiredRobot(broker, interface_name).connected(),
    ):
        await free(fleet)
        async with WiredRobot(broker, interface_name, one_too_many).connected():
            await until(lambda: fleet.fleet.statistics.robot_limit >= 2, what="its two messages")
        assert fleet.fleet.view(one_too_many.key).link is LinkStatus.UNKNOWN


async def test_a_robot_with_a_name_too_long_for_the_store_is_ignored(
    fleet: WiredFleet, robot: WiredRobot, broker: Broker, interface_name: str
) -> None:
    long = HonestRobot(key=RobotKey("Honest", "r" * KEY_LENGTH))
    async with WiredRobot(broker, interface_name, long).connected():
        await until(lambda: fleet.fleet.statistics.name_too_long >= 2, what="its two messages")
    robot.report()
    await free(fleet)
    assert fleet.fleet.view(long.key).link is LinkStatus.UNKNOWN


@pytest.mark.clause("4.1/offline")
async def test_a_vda_order_outlives_a_restart_of_the_broker(own_broker: Broker, interface_name: str) -> None:
    patient = FleetSettings(tick_interval=0.02, resend_after=0.1)
    async with (
        WiredFleet(own_broker, interface_name, patient).connected() as fleet,
        WiredRobot(own_broker, interface_name).connected() as robot,
    ):
        await free(fleet)
        fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B", "C"))
        await fleet.wait_for("VdaOrderAccepted")
        own_broker.kill()
        await until(lambda: "no connection" in str(fleet.fleet.view(ROBOT).wait_reason), what="the note")
        fleet.fleet.cancel_vda_order(ROBOT)
        own_broker.restart()
        await until(lambda: robot.link.state.connects >= 2, what="the robot's return")
        robot.report()
        await fleet.wait_for("VdaOrderCancelled")
        assert robot.robot.idle


@pytest.mark.clause("6.6/restart")
async def test_a_vda_order_is_adopted_by_a_new_process(
    broker: Broker, interface_name: str, robot: WiredRobot
) -> None:
    vda_order = make_vda_order("m", "A", "B", "C")
    async with WiredFleet(broker, interface_name).connected() as first:
        robot.report()
        await free(first)
        first.fleet.start_vda_order(ROBOT, vda_order)
        await first.wait_for("VdaOrderAccepted")
    robot.step()
    second = WiredFleet(broker, interface_name)
    second.fleet.adopt_vda_order(ROBOT, vda_order, accepted=True)
    async with second.connected():
        robot.step()
        await second.wait_for("VdaOrderFinished")
    assert robot.received["m"] == 1


@pytest.mark.clause("7.2/version", "4.2")
@pytest.mark.parametrize("version", ["2.0.0", "2.1.0", "3.0.0"])
async def test_a_robot_is_driven_in_its_own_version(
    fleet: WiredFleet, broker: Broker, interface_name: str, version: str
) -> None:
    wired = WiredRobot(broker, interface_name, version=version)
    with MqttPeer(broker, f"{interface_name}/+/+/+/order") as peer:
        async with wired.connected() as robot:
            await free(fleet)
            fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B", operation="pick"))
            await fleet.wait_for("VdaOrderAccepted")
            for _ in range(3):
                robot.step()
            await fleet.wait_for("VdaOrderFinished")
        order = await peer.wait_for(f"{interface_name}/v{version[0]}/Honest/robot-1/order")
    assert json.loads(order.payload)["version"] == version


@pytest.mark.clause("6.1.3/named")
@pytest.mark.parametrize(
    ("version", "parameters"),
    [("2.0.0", []), ("2.1.0", []), ("3.0.0", [{"key": "orderId", "value": "m"}])],
)
async def test_a_cancel_names_its_order_if_the_version_supports_it(
    fleet: WiredFleet, broker: Broker, interface_name: str, version: str, parameters: list[dict[str, str]]
) -> None:
    robot = HonestRobot(version=version, reports_instants_apart=version == "3.0.0")
    topic = f"{interface_name}/v{version[0]}/Honest/robot-1/instantActions"
    with MqttPeer(broker, topic) as peer:
        async with WiredRobot(broker, interface_name, robot, version).connected():
            await free(fleet)
            fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B"))
            await fleet.wait_for("VdaOrderAccepted")
            fleet.fleet.cancel_vda_order(ROBOT)
            await fleet.wait_for("VdaOrderCancelled")
        sent = json.loads((await cancel_sent(peer)).payload)
    assert schema_problems(version, Topic.INSTANT_ACTIONS, json.dumps(sent).encode()) == []
    (cancel,) = sent["actions"]
    assert (cancel["actionType"], cancel.get("actionParameters", [])) == ("cancelOrder", parameters)


@pytest.mark.clause("4.2")
async def test_a_robot_is_reached_by_the_plant_models_topics(broker: Broker, interface_name: str) -> None:
    own = f"{interface_name}/hall"
    vehicle = Vehicle(name="Tug", properties={"vda5050:interfaceName": own, "vda5050:version": "3.0"})
    stale = HonestRobot().connection(ConnectionState.ONLINE)
    with MqttPeer(broker) as peer:
        old = TopicScheme(interface_name, "v2").of(ROBOT, Topic.CONNECTION)
        peer.publish(old, codec_for("2.1.0").encode(stale), retain=True)
        async with (
            WiredFleet(broker, interface_name, vehicles={ROBOT: vehicle}).connected() as fleet,
            WiredRobot(broker, own, HonestRobot(version="3.0.0"), "3.0.0").connected() as robot,
        ):
            await free(fleet)
            fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B"))
            await fleet.wait_for("VdaOrderAccepted")
            robot.step()
            await fleet.wait_for("VdaOrderFinished")
        peer.publish(old, b"", retain=True)
    assert robot.received["m"] == 1


@pytest.mark.clause("4.2", "7.10")
@pytest.mark.parametrize("version", ["2.0.0", "3.0.0"])
async def test_a_new_process_uses_the_robots_version_from_its_first_message(
    broker: Broker, interface_name: str, version: str
) -> None:
    vda_order = make_vda_order("m", "A", "B")
    patient = FleetSettings(tick_interval=0.02, resend_after=0.1)
    with MqttPeer(
        broker, *(f"{interface_name}/+/+/+/{each}" for each in ("order", "instantActions"))
    ) as peer:
        wired = WiredRobot(broker, interface_name, HonestRobot(version=version), version)
        wired.tells_factsheet = False
        async with wired.connected():
            async with WiredFleet(broker, interface_name, patient).connected() as first:
                await until(lambda: first.fleet.view(ROBOT).link is LinkStatus.ONLINE, what="the robot")
            second = WiredFleet(broker, interface_name, patient)
            second.fleet.adopt_vda_order(ROBOT, vda_order, accepted=False)
            async with second.connected():
                wired.report()
                await second.wait_for("VdaOrderAccepted")
        peer.catch_up()
        messages = peer.received()
    assert {json.loads(each.payload)["version"] for each in messages} == {version}
    assert {each.topic.split("/")[-4] for each in messages} == {f"v{version[0]}"}
    assert any(b"factsheetRequest" in each.payload for each in messages)


@pytest.mark.provokes_failures  # the robot cannot read them
async def test_foreign_commands_are_logged_as_errors(
    fleet: WiredFleet, robot: WiredRobot, broker: Broker, interface_name: str
) -> None:
    await free(fleet)
    fleet.fleet.start_vda_order(ROBOT, make_vda_order("m", "A", "B"))
    await fleet.wait_for("VdaOrderAccepted")
    topic = robot.scheme.of(ROBOT, Topic.ORDER)
    with MqttPeer(broker, f"{interface_name}/#") as peer, capture_logs() as logs:
        assert fleet.fleet.statistics.foreign == 0
        peer.publish(topic, b'{"orderId": "of another fleet control"}')
        await until(lambda: fleet.fleet.statistics.foreign == 1)

    (alarm,) = [each for each in logs if each["event"].startswith("another program")]
    assert alarm["topic"] == topic
    assert "of another fleet control" in alarm["message"]
