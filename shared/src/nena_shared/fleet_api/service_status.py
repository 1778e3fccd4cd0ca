"""The order service's heartbeat over MQTT, with a last will."""

from __future__ import annotations

from typing import Final

from pydantic import Field

from nena_shared.fleet_api.base import Moment, Resource
from nena_shared.fleet_api.stops import SetBy, StopStatus
from nena_shared.mqtt.broker_check import BrokerLack

HEARTBEAT: Final = 1.0
"""Heartbeat interval, seconds."""

LOST_AFTER: Final = 4.0
"""Time without a heartbeat after which the order service counts as down, seconds."""


class ServiceStatus(Resource):
    """The status of the active order service; retained."""

    online: bool
    """False in the last will and after a graceful shutdown."""
    timestamp: Moment
    """Time by the order service's clock; in a last will, the time of connecting."""
    store_ready: bool = False
    """Whether new orders are accepted."""
    broker_lacks: tuple[BrokerLack, ...] = ()
    """What the MQTT broker does not do; unknown (empty) unless ``online``."""
    stops: tuple[StopStatus, ...] = ()
    """The active stops, the oldest first; unknown (empty) unless ``online``."""
    locked_paths: tuple[str, ...] = ()
    """The paths that hosts have locked, by name, at most 100; unknown (empty) unless ``online``."""
    locked_by: dict[str, SetBy] = Field(default_factory=dict)
    """Who has locked them, by path."""
