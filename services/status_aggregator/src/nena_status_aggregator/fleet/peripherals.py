"""Peripheral devices, as published by the order service.

The order service retains the status of each device at the broker, and clears it when the plant no longer
has the device.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

from nena_shared.fleet_api.peripherals import PeripheralStatus


@dataclass(slots=True)
class TrackedPeripheral:
    """A peripheral device and whether its status is current."""

    status: PeripheralStatus
    confirmed: bool = True
    """False if the broker connection was lost and no status has been received since."""


class PeripheralRegistry:
    """Known peripheral devices by location; beyond the limit, further ones are refused."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._devices: dict[str, TrackedPeripheral] = {}

    def get(self, location: str) -> TrackedPeripheral | None:
        """Return the device of a location."""
        return self._devices.get(location)

    def apply_status(self, status: PeripheralStatus) -> bool:
        """Apply a status; return False if the limit is reached."""
        if status.location not in self._devices and len(self._devices) >= self._limit:
            return False
        self._devices[status.location] = TrackedPeripheral(status)
        return True

    def remove(self, location: str) -> None:
        """Remove a device."""
        self._devices.pop(location, None)

    def mark_unconfirmed(self) -> list[str]:
        """Mark all devices as unconfirmed after a loss of the broker connection; return their locations."""
        for device in self._devices.values():
            device.confirmed = False
        return list(self._devices)

    def forget_unconfirmed(self, plant: Container[str]) -> list[str]:
        """Remove unconfirmed devices whose location is not in ``plant``; return their locations."""
        # Their topics were cleared while the broker connection was down, so nothing else removes them.
        removed = [
            name for name, device in self._devices.items() if not device.confirmed and name not in plant
        ]
        for location in removed:
            del self._devices[location]
        return removed
