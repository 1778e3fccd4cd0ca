"""Limits of services that work on the same fleet agree."""

from __future__ import annotations

from pathlib import PurePosixPath

from nena_deploy.site import LONGEST_MESSAGE, broker_configuration
from nena_order_service.settings import OrderServiceSettings
from nena_status_aggregator.fleet.model import ModelLimits
from nena_status_aggregator.settings import AggregatorSettings


def test_the_aggregator_has_room_for_each_robot_that_the_order_service_has_room_for() -> None:
    order_service = OrderServiceSettings.model_validate({"plant": "plant.xml"}).fleet.robots_limit
    assert AggregatorSettings().robots_limit >= order_service
    assert ModelLimits().robots >= order_service


RETAINED_OF_A_ROBOT = 4
"""connection, factsheet, vehicle status, map."""


def test_open_orders_have_more_room_than_the_ended_ones_that_the_aggregator_keeps() -> None:
    settings = AggregatorSettings()
    assert settings.open_orders_limit >= settings.robots_limit, "each robot may have an order"
    assert settings.open_orders_limit > settings.orders_limit


def test_the_broker_has_room_for_each_robot_that_the_services_have_room_for() -> None:
    folder = PurePosixPath("/site")
    lines = broker_configuration(folder, folder, 8883, LONGEST_MESSAGE).splitlines()
    limits = dict(line.split() for line in lines if line.startswith("max_"))
    services = AggregatorSettings()
    retained = RETAINED_OF_A_ROBOT * services.robots_limit + services.open_orders_limit
    assert int(limits["max_connections"]) > services.robots_limit
    assert int(limits["max_queued_messages"]) >= retained, (
        "a service that starts receives all of them at once"
    )
