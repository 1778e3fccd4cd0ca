"""The order service's heartbeat over MQTT; the broker reports its end by a last will."""

from __future__ import annotations

from typing import Final

from nena_shared.fleet_api.base import Moment, Resource

HEARTBEAT: Final = 2.0
"""Seconds between two heartbeats."""

LOST_AFTER: Final = 7.0
"""Seconds without one, after which the order service counts as down: it hangs, or is cut off."""


class ServiceStatus(Resource):
    """The status of the active order service; retained."""

    online: bool
    """False in its last will and at an orderly end."""
    timestamp: Moment
    """By its own clock; of a last will when it was made."""
    store_ready: bool = False
    """Whether new orders are accepted."""
