"""Statuses of an order service that another one has replaced do not reach the model."""

from __future__ import annotations

from nena_shared.clock import SystemClock
from nena_shared.fleet_api.epoch import with_epoch
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.vehicle import VehicleState
from nena_shared.mqtt import Inbound
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.mqtt import FleetSubscriber
from nena_status_aggregator.settings import AggregatorSettings
from support.fleet_examples import ROBOT, vehicle_status


async def test_an_older_epoch_changes_nothing() -> None:
    model = FleetModel(ModelLimits())
    link = FleetSubscriber(AggregatorSettings(), model, SystemClock())
    topic = FleetTopics().vehicle_status(ROBOT.serial_number)

    def publish(state: VehicleState, epoch: int) -> VehicleState | None:
        body = vehicle_status(state=state).model_dump_json(by_alias=True).encode()
        for handler in link.mqtt._handlers(topic):
            handler(Inbound(topic, with_epoch(body, epoch), retained=False))
        robot = model.robots.get(ROBOT)
        return robot.vehicle.state if robot and robot.vehicle else None

    assert publish(VehicleState.IDLE, 2) is VehicleState.IDLE
    assert publish(VehicleState.EXECUTING, 1) is VehicleState.IDLE
    assert publish(VehicleState.EXECUTING, 2) is VehicleState.EXECUTING
    assert publish(VehicleState.IDLE, 3) is VehicleState.IDLE
