"""Definitions of schedules for tests."""

from __future__ import annotations

from typing import Any

from nena_shared.fleet_api.schedules import ScheduleRequest
from nena_shared.fleet_api.transport_order import OrderTemplate


def definition(cron: str = "0 * * * *", zone: str = "UTC", **fields: Any) -> ScheduleRequest:
    """Make a definition whose order drives to ``A``."""
    template = OrderTemplate.model_validate({"destinations": [{"locationName": "A"}]})
    return ScheduleRequest(transport_order=template, cron=cron, time_zone=zone, **fields)
