"""Devices as their statuses come from the broker, from the subscription to the published view."""

from __future__ import annotations

import pytest

from nena_shared.clock import SystemClock
from nena_shared.fleet_api.epoch import with_epoch
from nena_shared.fleet_api.peripherals import PeripheralState
from nena_shared.fleet_api.topics import FleetTopics, PeripheralTopic
from nena_shared.mqtt import Inbound
from nena_shared.plant import Location, PlantModel
from nena_status_aggregator.fleet.messages import MessageKind
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.mqtt import FleetSubscriber
from nena_status_aggregator.settings import AggregatorSettings
from support.fleet_examples import peripheral_status
from support.fleet_examples import timestamp as at

DOOR = "Door 1/east"
"""With a sign that topics must not have."""
KIND = MessageKind.PERIPHERAL_STATUS


class Broker:
    """Delivers the statuses of devices to an aggregator."""

    def __init__(self, limits: ModelLimits | None = None) -> None:
        self.model = FleetModel(limits or ModelLimits())
        self.model.on_link(connected=True, at=at(0))
        self._link = FleetSubscriber(AggregatorSettings(), self.model, SystemClock())

    def deliver(self, location: str, body: bytes) -> None:
        topic = FleetTopics().peripheral(location, PeripheralTopic.STATUS)
        for handler in self._link.mqtt._handlers(topic):
            handler(Inbound(topic, body, retained=True))

    def publish(self, state: PeripheralState, *, location: str = DOOR, epoch: int = 1) -> None:
        body = peripheral_status(location, state).model_dump_json(by_alias=True).encode()
        self.deliver(location, with_epoch(body, epoch))

    def shown(self) -> list[tuple[str, str, bool]]:
        self.model.flush(at(0))
        return [
            (each["id"], each["state"], each["confirmed"]) for each in self.model.snapshot()["peripherals"]
        ]


@pytest.fixture
def broker() -> Broker:
    return Broker()


def test_the_last_status_of_the_newest_order_service_is_shown(broker: Broker) -> None:
    broker.publish(PeripheralState.IDLE, epoch=2)
    broker.publish(PeripheralState.EXECUTING, epoch=2)
    broker.publish(PeripheralState.ERROR, epoch=1)
    assert broker.shown() == [(DOOR, "EXECUTING", True)]
    assert broker.model.statistics.received[KIND] == 2


def test_a_device_that_the_plant_no_longer_has_is_removed(broker: Broker) -> None:
    broker.publish(PeripheralState.IDLE)
    broker.publish(PeripheralState.IDLE, location="Lift")
    assert len(broker.shown()) == 2
    broker.deliver(DOOR, b"")
    assert broker.shown() == [("Lift", "IDLE", True)]


def test_devices_are_unconfirmed_after_a_lost_connection(broker: Broker) -> None:
    broker.publish(PeripheralState.IDLE)
    broker.publish(PeripheralState.IDLE, location="Lift")
    broker.model.on_link(connected=False, at=at(1))
    broker.model.on_link(connected=True, at=at(2))
    broker.publish(PeripheralState.IDLE)
    assert broker.shown() == [(DOOR, "IDLE", True), ("Lift", "IDLE", False)]


def test_a_device_removed_during_a_lost_connection_goes_with_the_new_plant(broker: Broker) -> None:
    broker.publish(PeripheralState.IDLE)
    broker.publish(PeripheralState.IDLE, location="Lift")
    broker.model.on_link(connected=False, at=at(1))
    assert [each for each, *_ in broker.shown()] == [DOOR, "Lift"]
    lift = Location(name="Lift", x_mm=0, y_mm=0, type="Lifts")
    broker.model.on_plant_model(PlantModel(name="without the door", locations=(lift,)))
    assert broker.shown() == [("Lift", "IDLE", False)]


def test_an_unreadable_status_is_counted_and_changes_nothing(broker: Broker) -> None:
    broker.publish(PeripheralState.IDLE)
    broker.deliver(DOOR, with_epoch(b'{"state": "OPEN"}', 1))
    assert broker.shown() == [(DOOR, "IDLE", True)]
    assert broker.model.statistics.malformed[KIND] == 1


def test_devices_beyond_the_limit_are_refused() -> None:
    broker = Broker(ModelLimits(peripherals=1))
    broker.publish(PeripheralState.IDLE)
    broker.publish(PeripheralState.IDLE, location="Lift")
    broker.publish(PeripheralState.EXECUTING)
    assert broker.shown() == [(DOOR, "EXECUTING", True)]
    assert broker.model.snapshot()["malformed"]["lastProblem"] == "more than 1 devices; this one is not shown"
