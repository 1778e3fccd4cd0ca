"""What robots and the order service publish shows up in the API, the metrics and the event stream."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest

from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.plant import Vehicle
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_shared.vda5050.v2_1 import CODEC
from nena_shared.vda5050.v3_0 import CODEC as CODEC_3
from support.broker import Broker, MqttPeer
from support.fleet_examples import (
    ROBOT,
    START,
    connection,
    factsheet,
    order_status,
    position,
    sample_plant,
    state,
    vehicle_status,
    visualization,
    way,
)
from support.robot_maps import robot_map
from support.served_aggregator import EventReader, Served, serving

pytestmark = pytest.mark.broker


async def test_robot_is_followed_from_its_first_message_to_offline(broker: Broker, served: Served) -> None:
    robot = "/api/v1/robots/ACME/r1"
    with MqttPeer(broker) as peer:
        peer.publish(served.robots.of(ROBOT, Topic.CONNECTION), b"", retain=True)
        served.send(peer, Topic.CONNECTION, connection(), retain=True)
        served.send(peer, Topic.FACTSHEET, factsheet(), retain=True)
        served.send(peer, Topic.STATE, state(order_id="o1", driving=True, last_node_id="A", **way("B", "C")))
        busy = await served.until(robot, lambda shown: shown.get("condition") == "BUSY")
        assert (busy["reason"], busy["order"]["progress"]) == ("Driving to B.", 0)
        served.send(peer, Topic.VISUALIZATION, visualization(x=3.5))
        await served.until(robot, lambda shown: (shown["position"] or {}).get("x") == 3.5)
        done = state(2, at=1, order_id="o1", last_node_id="C", last_node_sequence_id=4)
        served.send(peer, Topic.STATE, done)
        idle = await served.until(robot, lambda shown: shown["condition"] == "IDLE")
        assert idle["order"]["progress"] == 100
        await served.metric('nena_robots{condition="IDLE"} 1.0')
        will = connection("CONNECTION_BROKEN", 0, at=-50)
        served.send(peer, Topic.CONNECTION, will, retain=True)
        broken = await served.until(robot, lambda shown: shown["condition"] == "BROKEN")
        assert (broken["connection"], broken["malformed"]) == ("CONNECTION_BROKEN", 0)
        await served.metric('nena_robots{condition="BROKEN"} 1.0')


@pytest.mark.parametrize(
    "payload", [b"", b"{", b"[]", b'{"headerId": "one"}', b"\xff\xfe", b'{"headerId": 1e999}']
)
async def test_malformed_state_is_counted_and_shown(broker: Broker, served: Served, payload: bytes) -> None:
    with MqttPeer(broker) as peer:
        served.send(peer, Topic.STATE, state(last_node_id="A"))
        peer.publish(served.robots.of(ROBOT, Topic.STATE), payload)
        fleet = await served.until(
            "/api/v1/fleet", lambda shown: shown["robots"] and shown["robots"][0]["condition"] == "ERROR"
        )
        assert fleet["malformed"]["counts"] == {"state": 1}
        assert fleet["malformed"]["lastTopic"].endswith("ACME/r1/state")
        (robot,) = fleet["robots"]
        assert (robot["condition"], robot["order"], robot["malformed"]) == ("ERROR", None, 1)
        await served.metric('nena_messages_malformed_total{topic="state"} 1.0')
        served.send(peer, Topic.STATE, state(2, at=1, driving=True))
        await served.until("/api/v1/robots/ACME/r1", lambda shown: shown["condition"] == "BUSY")


async def test_deviations_of_a_robot_are_shown(broker: Broker, served: Served) -> None:
    robot, here = "/api/v1/robots/ACME/r1", served.robots.of(ROBOT, Topic.STATE)
    with MqttPeer(broker) as peer:
        served.send(peer, Topic.STATE, state())
        await served.until(robot, lambda shown: shown.get("deviations") == [])
        peer.publish(here, CODEC.encode(state(2, at=1)).replace(b'"errors":[]', b'"errors":null'))
        shown = await served.until(robot, lambda shown: shown["deviations"])
        assert shown["deviations"] == ["state.errors null: empty list"]
        assert (shown["condition"], shown["malformed"]) == ("IDLE", 0)
        served.send(peer, Topic.STATE, state(3, at=2, driving=True))
        shown = await served.until(robot, lambda shown: shown["driving"])
        assert shown["deviations"] == ["state.errors null: empty list"]


async def test_orders_vehicles_and_plant_of_the_order_service(broker: Broker, served: Served) -> None:
    with MqttPeer(broker) as peer:
        plant = sample_plant()
        peer.publish(served.fleet.plant_model, plant.to_json(), retain=True)
        vehicle = vehicle_status(transport_order="TO-1")
        peer.publish(served.fleet.vehicle_status("r1"), vehicle.model_dump_json(by_alias=True), retain=True)
        order_topic = served.fleet.order_status("TO-1")
        peer.publish(order_topic, order_status().model_dump_json(by_alias=True), retain=True)
        served.send(peer, Topic.STATE, state(last_node_id="C"))
        orders = await served.until("/api/v1/orders", lambda shown: shown and shown[0]["progress"])
        assert (orders[0]["processingVehicle"], orders[0]["progress"]) == ("Vehicle-1", 22.5)
        fleet = await served.get("/api/v1/fleet")
        assert fleet["plant"] == {
            "version": 1,
            "name": plant.name,
            "points": len(plant.points),
            "paths": len(plant.paths),
            "locations": len(plant.locations),
        }
        assert fleet["robots"][0]["name"] == "Vehicle-1"
        final = order_status(version=2, state=TransportOrderState.FINISHED, finished=datetime.now(UTC))
        peer.publish(order_topic, final.model_dump_json(by_alias=True), retain=True)
        peer.publish(order_topic, b"", retain=True)
        ended = await served.until("/api/v1/orders", lambda shown: shown[0]["final"])
        assert ended[0]["progress"] == 100
        await served.metric('nena_transport_orders_ended_total{state="FINISHED"} 1.0')
        peer.publish(served.fleet.plant_model, b"no plant")
        await served.metric('nena_messages_malformed_total{topic="plantModel"} 1.0')
        assert (await served.get("/api/v1/fleet"))["plant"] is not None


async def test_retained_messages_are_read_at_startup(broker: Broker, interface_name: str) -> None:
    with MqttPeer(broker) as peer:
        robots = TopicScheme(interface_name)
        old = state(at=(datetime.now(UTC) - START).total_seconds() - 300)
        for topic, message in ((Topic.CONNECTION, connection()), (Topic.STATE, old)):
            peer.publish(robots.of(ROBOT, topic), CODEC.encode(message), retain=True)
        async with serving(broker, interface_name) as served:
            robot = "/api/v1/robots/ACME/r1"
            shown = await served.until(robot, lambda shown: shown.get("lastState"))
            assert shown["condition"] == "SILENT"
            assert 299 < shown["stateAge"] < 320


async def test_event_stream_contains_all_changes_and_lets_a_client_catch_up(
    broker: Broker, served: Served
) -> None:
    with MqttPeer(broker) as peer:
        async with EventReader.open(served.http) as events:
            snapshot = await events.next("snapshot")
            assert snapshot["robots"] == []
            served.send(peer, Topic.STATE, state(mobile_robot_position=position(1, 2)))
            delta = await events.next("delta", lambda data: "robots" in data)
            assert delta["robots"][0]["position"]["x"] == 1
            number = events.last_id
        served.send(peer, Topic.STATE, state(2, at=1, driving=True))
        await served.until("/api/v1/robots/ACME/r1", lambda shown: shown["condition"] == "BUSY")
        async with EventReader.open(served.http, last_id=number) as events:
            missed = await events.next("delta")
            assert missed["id"] == delta["id"] + 1
            assert missed["robots"][0]["condition"] == "BUSY"
            assert "manufacturer" not in missed["robots"][0]


async def test_silent_robot_is_reported_without_a_message(broker: Broker, interface_name: str) -> None:
    async with serving(broker, interface_name, silence_limit=0.3) as served:
        with MqttPeer(broker) as peer:
            async with EventReader.open(served.http) as events:
                served.send(peer, Topic.STATE, state())
                silent = await events.next(
                    "delta", lambda data: data.get("robots", [{}])[0].get("condition") == "SILENT"
                )
        assert silent["robots"][0]["reason"].startswith("No state since")


async def test_broker_disappears_and_returns(own_broker: Broker, interface_name: str) -> None:
    async with serving(own_broker, interface_name) as served:
        with MqttPeer(own_broker) as peer:
            order = order_status().model_dump_json(by_alias=True)
            peer.publish(served.fleet.order_status("TO-1"), order, retain=True)
            await served.until("/api/v1/orders", bool)
        own_broker.kill()
        await served.until("/api/v1/fleet", lambda fleet: not fleet["link"]["connected"])
        assert (await served.http.get("/readyz")).status_code == 503
        await served.until("/api/v1/orders", lambda orders: not orders[0]["confirmed"])
        own_broker.start()
        await served.until("/api/v1/fleet", lambda fleet: fleet["link"]["connected"])
        with MqttPeer(own_broker) as peer:
            peer.publish(served.fleet.order_status("TO-1"), order, retain=True)
            served.send(peer, Topic.STATE, state())
            await served.until("/api/v1/orders", lambda orders: orders[0]["confirmed"])
            await served.until("/api/v1/robots/ACME/r1", lambda shown: shown.get("condition") == "IDLE")
        await served.metric("nena_mqtt_connects_total 2.0")


async def test_other_interfaces_and_topics_are_ignored(broker: Broker, served: Served) -> None:
    with MqttPeer(broker) as peer:
        peer.publish(f"other/v2/ACME/r9/{Topic.STATE}", b"{}")
        served.send(peer, Topic.STATE, state(robot=RobotKey("ACME", "r2")), robot=RobotKey("ACME", "r2"))
        fleet = await served.until("/api/v1/fleet", lambda shown: shown["robots"])
        assert [each["id"] for each in fleet["robots"]] == ["ACME/r2"]
        assert fleet["malformed"]["counts"] == {}
        endless = RobotKey("A" * 300, "r1")
        served.send(peer, Topic.STATE, state(), robot=endless)
        await served.metric('nena_messages_malformed_total{topic="state"} 1.0')
        assert len((await served.get("/api/v1/fleet"))["robots"]) == 1


@pytest.mark.clause("4.2")
async def test_retained_messages_of_an_older_version_are_ignored(broker: Broker, interface_name: str) -> None:
    old, new = TopicScheme(interface_name, "v2"), TopicScheme(f"{interface_name}-3", "v3")
    with MqttPeer(broker) as peer:
        peer.publish(old.of(ROBOT, Topic.CONNECTION), CODEC.encode(connection("OFFLINE")), retain=True)
        newer = connection("ONLINE", at=9).model_copy(update={"version": "3.0.0"})
        peer.publish(new.of(ROBOT, Topic.CONNECTION), CODEC_3.encode(newer), retain=True)
        async with serving(broker, interface_name, interface_name_v3=f"{interface_name}-3") as served:
            robot = "/api/v1/robots/ACME/r1"
            now = state(at=10).model_copy(update={"version": "3.0.0"})
            peer.publish(new.of(ROBOT, Topic.STATE), CODEC_3.encode(now))
            await served.until(robot, lambda shown: shown.get("condition") == "IDLE")
            peer.publish(old.of(ROBOT, Topic.CONNECTION), b"", retain=True)

            shown = await served.until(robot, lambda shown: shown["connection"])

        assert shown["connection"] == "ONLINE"
        peer.publish(new.of(ROBOT, Topic.CONNECTION), b"", retain=True)


@pytest.mark.clause("4.2")
async def test_late_will_of_an_older_version_is_ignored(broker: Broker, interface_name: str) -> None:
    old, new = TopicScheme(interface_name, "v2"), TopicScheme(f"{interface_name}-3", "v3")
    robot = "/api/v1/robots/ACME/r1"
    with MqttPeer(broker) as peer:
        async with serving(broker, interface_name, interface_name_v3=f"{interface_name}-3") as served:
            peer.publish(old.of(ROBOT, Topic.CONNECTION), CODEC.encode(connection("ONLINE")))
            await served.until(robot, lambda shown: shown.get("connection") == "ONLINE")
            now = state(at=10).model_copy(update={"version": "3.0.0"})
            peer.publish(new.of(ROBOT, Topic.STATE), CODEC_3.encode(now))
            await served.until(robot, lambda shown: shown.get("condition") == "IDLE")

            will = connection("CONNECTION_BROKEN", 0, at=20)
            peer.publish(old.of(ROBOT, Topic.CONNECTION), CODEC.encode(will))
            second = connection("ONLINE").model_copy(update={"serial_number": "r2"})
            peer.publish(old.of(RobotKey("ACME", "r2"), Topic.CONNECTION), CODEC.encode(second))
            await served.until("/api/v1/robots/ACME/r2", lambda shown: shown.get("connection"))
            shown = await served.get(robot)

    assert (shown["connection"], shown["condition"]) == ("ONLINE", "IDLE")


@pytest.mark.clause("4.2")
async def test_robot_with_custom_topics_is_shown(broker: Broker, interface_name: str, served: Served) -> None:
    own = TopicScheme(f"{interface_name}/hall", "v3")
    tug = Vehicle(name="Tug", properties={"vda5050:interfaceName": own.interface_name})
    odd = Vehicle(name="Odd", properties={"vda5050:interfaceName": "#"})
    plant = sample_plant().model_copy(update={"vehicles": (odd, tug)})
    online = connection().model_copy(update={"version": "3.0.0"})
    with MqttPeer(broker) as peer:
        peer.publish(own.of(ROBOT, Topic.CONNECTION), CODEC_3.encode(online), retain=True)
        peer.publish(served.fleet.plant_model, plant.to_json().encode())

        shown = await served.until("/api/v1/robots/ACME/r1", lambda shown: shown.get("connection"))

        peer.publish(own.of(ROBOT, Topic.CONNECTION), b"", retain=True)
    assert shown["connection"] == "ONLINE"


async def test_robot_map_is_an_image_with_its_position(broker: Broker, served: Served) -> None:
    robot = "/api/v1/robots/ACME/r1"
    with MqttPeer(broker) as peer:
        topic = served.fleet.robot_map(ROBOT)
        sent = robot_map(x=-2.0)
        peer.publish(topic, sent.model_dump_json(by_alias=True), retain=True)
        shown = await served.until(robot, lambda shown: shown.get("grid") is not None)
        assert (shown["grid"]["x"], shown["grid"]["width"]) == (-2.0, 40)
        image = await served.http.get(f"{robot}/map")
        assert (image.headers["content-type"], image.content) == ("image/png", sent.png)
        peer.publish(topic, b'{"mapId": "hall"}')
        await served.metric('nena_messages_malformed_total{topic="robotMap"} 1.0')
        assert (await served.http.get(f"{robot}/map")).content == sent.png
        peer.publish(topic, b"", retain=True)
        await served.until(robot, lambda shown: shown["grid"] is None)
        assert (await served.http.get(f"{robot}/map")).status_code == 404
