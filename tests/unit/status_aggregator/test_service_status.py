"""Signs of life of the order service, as they come from the broker."""

from __future__ import annotations

from nena_shared.clock import SystemClock
from nena_shared.fleet_api.service_status import ServiceStatus
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.mqtt import Inbound
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.fleet.robot import Timestamp
from nena_status_aggregator.mqtt import FleetSubscriber
from nena_status_aggregator.settings import AggregatorSettings


async def test_order_service_is_forgotten_once_its_retained_status_is_cleared() -> None:
    clock, model = SystemClock(), FleetModel(ModelLimits())
    link = FleetSubscriber(AggregatorSettings(), model, clock)
    topic = FleetTopics().service_status

    def publish(body: bytes) -> bool | None:
        for handler in link.mqtt._handlers(topic):
            handler(Inbound(topic, body, retained=False))
        return model.order_service.is_up(Timestamp.of(clock))

    last_will = ServiceStatus(online=False, timestamp=clock.now(), store_ready=False)
    assert publish(last_will.model_dump_json(by_alias=True).encode()) is False
    assert publish(b"") is None
    assert sum(model.statistics.malformed.values()) == 0
