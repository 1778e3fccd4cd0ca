"""Which topics of robots a plant model adds."""

from __future__ import annotations

from nena_shared.plant import Vehicle
from nena_shared.vda5050.topics import RobotKey, TopicScheme
from nena_status_aggregator.mqtt import schemes_of


def test_prefixes_and_interface_names_of_vehicles_are_heard() -> None:
    vehicles = [
        Vehicle(name="V1", properties={"vda5050:topicPrefix": "site/V1", "vda5050:interfaceName": "acme"}),
        Vehicle(name="V2", properties={"vda5050:topicPrefix": "site/#"}),
        Vehicle(name="V3", properties={"vda5050:interfaceName": "hall"}),
        Vehicle(name="V4", properties={"vda5050:topicPrefix": "x/v3/NeNa/V4", "vda5050:version": "3.0"}),
    ]
    assert schemes_of(vehicles) == (
        TopicScheme("site/V1", "v2", RobotKey("NeNa", "V1")),
        TopicScheme("hall", "v2"),
        TopicScheme("hall", "v3"),
        TopicScheme("x", "v3"),
    )
