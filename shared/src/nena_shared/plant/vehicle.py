"""Vehicles: the robots that a plant model names, with what a dispatcher must know of them."""

from collections.abc import Mapping
from math import isfinite, radians
from typing import Self

from pydantic import Field, model_validator

from nena_shared.plant import property_keys as keys
from nena_shared.plant.geometry import FAR_MM, MM_PER_M, BoundingBox
from nena_shared.plant.record import PlantRecord


class EnergyThresholds(PlantRecord):
    """Charge levels in whole percent; critical <= good and sufficiently <= fully recharged."""

    critical: int = Field(default=30, ge=0, le=100)
    good: int = Field(default=90, ge=0, le=100)
    sufficiently_recharged: int = Field(default=30, ge=0, le=100)
    fully_recharged: int = Field(default=90, ge=0, le=100)

    @model_validator(mode="after")
    def _not_crossed(self) -> Self:
        if self.critical > self.good or self.sufficiently_recharged > self.fully_recharged:
            msg = "crossed energy thresholds: critical <= good and sufficiently <= fully recharged must hold"
            raise ValueError(msg)
        return self


class Vehicle(PlantRecord):
    """A vehicle; its properties carry what its VDA 5050 interface needs."""

    name: str = Field(min_length=1)
    bounding_box: BoundingBox = BoundingBox()
    energy_thresholds: EnergyThresholds = EnergyThresholds()
    max_velocity_mm_s: int = Field(default=1000, ge=0, le=FAR_MM)
    max_reverse_velocity_mm_s: int = Field(default=1000, ge=0, le=FAR_MM)
    envelope_key: str | None = None
    properties: Mapping[str, str] = Field(default_factory=dict)
    color: str | None = None

    @property
    def max_velocity_m_s(self) -> float:
        """The highest forward speed in m/s."""
        return self.max_velocity_mm_s / MM_PER_M

    @property
    def routing_group(self) -> str:
        """The name of the routing group (property `tcs:routingGroup`), empty for the common one."""
        return self.properties.get(keys.ROUTING_GROUP, "")

    @property
    def manufacturer(self) -> str | None:
        """The robot's manufacturer as its VDA 5050 topics name it, if the plant model says so."""
        return self.properties.get(keys.VDA5050_MANUFACTURER)

    @property
    def serial_number(self) -> str | None:
        """The robot's serial number as its VDA 5050 topics name it, if the plant model says so."""
        return self.properties.get(keys.VDA5050_SERIAL_NUMBER)

    @property
    def interface_name(self) -> str | None:
        """The first level of the robot's VDA 5050 topics, if the plant model says so."""
        return self.properties.get(keys.VDA5050_INTERFACE_NAME)

    @property
    def protocol_version(self) -> str | None:
        """The VDA 5050 version that the robot speaks, if the plant model says so."""
        return self.properties.get(keys.VDA5050_VERSION)

    @property
    def map_id(self) -> str | None:
        """The map on which the robot drives, if the plant model says so."""
        return self.properties.get(keys.VDA5050_MAP_ID)

    @property
    def vehicle_type(self) -> str | None:
        """The robot's type as LIF names it, if the plant model says so."""
        return self.properties.get(keys.VEHICLE_TYPE)

    @property
    def allowed_maps(self) -> frozenset[str] | None:
        """The maps on which the robot may drive; None: all."""
        if not (value := self.properties.get(keys.ALLOWED_MAPS)):
            return None
        return frozenset(name.strip() for name in value.split(","))

    @property
    def acceptable_order_types(self) -> tuple[str, ...] | None:
        """The types of orders that the robot accepts, the one it likes best first; None: any."""
        if not (value := self.properties.get(keys.ACCEPTABLE_ORDER_TYPES)):
            return None
        return tuple(name for part in value.split(",") if (name := part.strip()))

    @property
    def deviation_xy_m(self) -> float | None:
        """The allowed deviation from a node's position in metres; None if unset or no number >= 0."""
        return self._non_negative(keys.VDA5050_DEVIATION_XY)

    @property
    def deviation_theta_rad(self) -> float | None:
        """The allowed deviation from a node's heading in radians (the property: degrees); None as above."""
        degrees = self._non_negative(keys.VDA5050_DEVIATION_THETA)
        return None if degrees is None else radians(degrees)

    def _non_negative(self, key: str) -> float | None:
        try:
            value = float(self.properties[key])
        except (KeyError, ValueError):
            return None
        return value if isfinite(value) and value >= 0 else None
