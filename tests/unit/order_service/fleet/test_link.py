"""Where robots are spoken to."""

from __future__ import annotations

import pytest

from nena_order_service.fleet.failures import RobotBusyError
from nena_order_service.fleet.link import KEY_LENGTH, FleetLink, RobotAddresses
from nena_order_service.fleet.settings import FleetSettings
from nena_shared.mqtt import MqttLink
from nena_shared.plant import Vehicle
from nena_shared.settings import ConfigurationError, MqttSettings
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.topics import RobotKey, TopicScheme
from nena_shared.vda5050.versions import codec_for
from support.clocks import ManualClock
from support.fleet import make_vda_order
from support.honest_robot import HonestRobot

pytestmark = pytest.mark.clause("4.2")

ROBOT = RobotKey("ACME", "r1")
HELLO = HonestRobot(key=ROBOT).connection(ConnectionState.ONLINE)
V2, V3 = TopicScheme("uagv", "v2"), TopicScheme("vda5050", "v3")


def addresses(**properties: str) -> RobotAddresses:
    known = RobotAddresses([V2, V3])
    vehicle = Vehicle(name="Tug", properties={f"vda5050:{key}": value for key, value in properties.items()})
    known.expect([(ROBOT, vehicle)])
    return known


def test_a_robot_that_nobody_knows_has_no_address() -> None:
    assert addresses().of(ROBOT) is None
    assert addresses().schemes == (V2, V3)


@pytest.mark.parametrize(
    ("written", "version", "scheme"),
    [
        ("2.0.0", "2.0.0", V2),
        ("2.0", "2.0.0", V2),
        ("2.1", "2.1.0", V2),
        ("3.0.0", "3.0.0", V3),
        ("3.0", "3.0.0", V3),
    ],
)
def test_the_plant_model_names_its_version(written: str, version: str, scheme: TopicScheme) -> None:
    address = addresses(version=written).of(ROBOT)

    assert address is not None
    assert (address.codec.version, address.scheme) == (version, scheme)


@pytest.mark.parametrize("name", ["#", "a/+/b", "uagv/"])
def test_an_interface_name_that_is_no_topic_is_an_error_of_the_plant_model(name: str) -> None:
    with pytest.raises(ConfigurationError, match=r"vehicle 'Tug', property vda5050:interfaceName"):
        addresses(interfaceName=name)


def test_the_plant_model_names_its_topics() -> None:
    known = addresses(version="2.0.0", interfaceName="acme/hall")
    address = known.of(ROBOT)

    assert address is not None
    assert address.scheme == TopicScheme("acme/hall", "v2")
    assert known.schemes == (V2, V3, TopicScheme("acme/hall", "v2"), TopicScheme("acme/hall", "v3"))


def test_a_version_that_is_not_spoken_here_is_an_error_of_the_plant_model() -> None:
    with pytest.raises(ConfigurationError, match=r"vehicle 'Tug', property vda5050:version.*'1\.1'"):
        addresses(version="1.1")


def test_a_robot_that_the_store_cannot_hold_is_an_error_of_the_plant_model() -> None:
    long = RobotKey("ACME", "r" * KEY_LENGTH)
    with pytest.raises(ConfigurationError, match=r"vehicle 'Tug'.*more than 400 characters"):
        RobotAddresses([V2, V3]).expect([(long, Vehicle(name="Tug"))])


def test_what_a_robot_says_counts_more_than_what_was_expected() -> None:
    known = addresses(version="2.0.0")

    assert known.learn(ROBOT, codec_for("3.0.0"), V3, HELLO, retained=False)

    address = known.of(ROBOT)
    assert address is not None
    assert address.scheme == V3


def test_what_the_broker_kept_from_another_time_is_known() -> None:
    known = addresses(version="3.0.0")

    assert not known.learn(ROBOT, codec_for("2.1.0"), V2, HELLO, retained=True)
    address = known.of(ROBOT)
    assert address is not None
    assert address.scheme == V3


def test_an_order_that_a_busy_robot_does_not_get_is_not_counted_as_undelivered() -> None:
    link = FleetLink(
        MqttLink(MqttSettings(), client_id="c"),
        addresses=RobotAddresses([V2]),
        settings=FleetSettings(),
        clock=ManualClock(),
        on_events=lambda *_: None,
    )
    link.start_vda_order(ROBOT, make_vda_order("m1", "A", "B"))

    with pytest.raises(RobotBusyError):
        link.start_vda_order(ROBOT, make_vda_order("m2", "A", "B"))
    with pytest.raises(RobotBusyError):
        link.adopt_vda_order(ROBOT, make_vda_order("m3", "A", "B"), accepted=False)

    assert link.statistics.undelivered == 1
