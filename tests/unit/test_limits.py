"""Limits of services that work on the same fleet agree."""

from __future__ import annotations

from nena_order_service.settings import OrderServiceSettings
from nena_status_aggregator.fleet.model import ModelLimits
from nena_status_aggregator.settings import AggregatorSettings


def test_the_aggregator_has_room_for_each_robot_that_the_order_service_has_room_for() -> None:
    order_service = OrderServiceSettings.model_validate({"plant": "plant.xml"}).fleet.robots_limit
    assert AggregatorSettings().robots_limit >= order_service
    assert ModelLimits().robots >= order_service
