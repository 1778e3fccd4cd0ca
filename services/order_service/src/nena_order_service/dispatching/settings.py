"""Settings of the dispatcher."""

from __future__ import annotations

from enum import StrEnum
from typing import Self

from pydantic import Field, model_validator

from nena_shared.plant.model import EnergyThresholds
from nena_shared.settings import SettingsGroup


class OrderKey(StrEnum):
    """Sort keys of waiting orders."""

    BY_PRIORITY = "BY_PRIORITY"
    """The greater priority first."""
    BY_DEADLINE = "BY_DEADLINE"
    """The earlier deadline first, those without one last."""
    DEADLINE_AT_RISK_FIRST = "DEADLINE_AT_RISK_FIRST"
    """First those whose deadline is near or past."""
    BY_AGE = "BY_AGE"
    """The older one first."""
    BY_NAME = "BY_NAME"


class VehicleKey(StrEnum):
    """Sort keys of free vehicles."""

    BY_ENERGY_LEVEL = "BY_ENERGY_LEVEL"
    """The one with more energy first."""
    IDLE_FIRST = "IDLE_FIRST"
    """First those that neither charge nor have a dispensable order."""
    BY_NAME = "BY_NAME"


class CandidateKey(StrEnum):
    """Sort keys of pairs of an order and a vehicle."""

    BY_COMPLETE_ROUTING_COSTS = "BY_COMPLETE_ROUTING_COSTS"
    """The cheaper route through all destinations first."""
    BY_INITIAL_ROUTING_COSTS = "BY_INITIAL_ROUTING_COSTS"
    """The cheaper route to the first destination first."""
    BY_ORDER_TYPE_PRIORITY = "BY_ORDER_TYPE_PRIORITY"
    """By the priority that the vehicle has for orders of this type, the smaller number first."""
    BY_PRIORITY = "BY_PRIORITY"
    BY_DEADLINE = "BY_DEADLINE"
    DEADLINE_AT_RISK_FIRST = "DEADLINE_AT_RISK_FIRST"
    BY_AGE = "BY_AGE"
    BY_ORDER_NAME = "BY_ORDER_NAME"
    BY_ENERGY_LEVEL = "BY_ENERGY_LEVEL"
    IDLE_FIRST = "IDLE_FIRST"
    BY_VEHICLE_NAME = "BY_VEHICLE_NAME"


class Chooser(StrEnum):
    """The assignment method."""

    TOGETHER = "TOGETHER"
    """Neither: equally urgent orders and free vehicles are paired with the least driving in total."""
    ORDERS = "ORDERS"
    """Each order in turn chooses a vehicle."""
    SCARCER = "SCARCER"
    """As in openTCS: if fewer vehicles are free than orders wait, vehicles choose orders."""


class EnergySettings(SettingsGroup):
    """How the energy of vehicles affects dispatching."""

    respected: bool = Field(
        default=True,
        description="Vehicles with critical energy, or recharging, take no other orders. Set to false for "
        "robots that do not report their charge.",
    )
    until_fully_recharged: bool = Field(
        default=True,
        description="Recharge fully before the next order. false: sufficiently.",
    )
    critical: int = Field(
        30, ge=0, le=100, description="Critical energy of vehicles that are not in the plant model, percent."
    )
    good: int = Field(
        90,
        ge=0,
        le=100,
        description="Good energy of these vehicles, percent; idle vehicles recharge below it.",
    )
    sufficiently_recharged: int = Field(
        30, ge=0, le=100, description="Charge from which they count as sufficiently recharged, percent."
    )
    fully_recharged: int = Field(
        90, ge=0, le=100, description="Charge from which they count as fully recharged, percent."
    )

    @model_validator(mode="after")
    def _not_crossed(self) -> Self:
        self.thresholds  # noqa: B018 - raises ValueError where they are crossed
        return self

    @property
    def thresholds(self) -> EnergyThresholds:
        """The thresholds of vehicles that the plant model lacks."""
        return EnergyThresholds(
            critical=self.critical,
            good=self.good,
            sufficiently_recharged=self.sufficiently_recharged,
            fully_recharged=self.fully_recharged,
        )


class RechargingSettings(SettingsGroup):
    """Sends idle vehicles to recharge."""

    enabled: bool = Field(
        default=False,
        description="Send idle vehicles without good energy to recharge (off by default, as in openTCS).",
    )


class ParkingSettings(SettingsGroup):
    """Sends idle vehicles to parking positions."""

    enabled: bool = Field(
        default=False, description="Send idle vehicles to parking positions (off by default, as in openTCS)."
    )
    delay: float = Field(5.0, ge=0, description="Idle time before a vehicle is sent to park, seconds.")
    priorities: bool = Field(
        default=False,
        description="Prefer tcs:parkingPositionPriority (smaller is better) to the route's cost.",
    )
    repark: bool = Field(
        default=False,
        description="Move a parked vehicle to a free position of better priority.",
    )


class DispatchSettings(SettingsGroup):
    """How orders are assigned to vehicles."""

    choosers: Chooser = Field(
        Chooser.TOGETHER,
        description="Assignment method: TOGETHER (orders of the same urgency and free vehicles at the least "
        "total cost), ORDERS (each order in turn chooses), or SCARCER (orders or vehicles choose, depending "
        "on which are fewer, as in openTCS).",
    )
    age_window: float = Field(
        300.0,
        ge=0,
        description="With TOGETHER: how much later a nearer order may have been created to be assigned "
        "first, seconds. 0: strictly by age.",
    )
    crowding: float = Field(
        0.1,
        ge=0,
        description="With TOGETHER: share by which the cost of an order rises for each vehicle that will "
        "still visit one of its destinations. 0: crowded stations do not count.",
    )
    orders: list[OrderKey] = Field(
        [OrderKey.BY_PRIORITY, OrderKey.BY_DEADLINE, OrderKey.BY_AGE],
        min_length=1,
        description="Sort keys of waiting orders.",
    )
    vehicles: list[VehicleKey] = Field(
        [VehicleKey.IDLE_FIRST, VehicleKey.BY_ENERGY_LEVEL, VehicleKey.BY_NAME],
        min_length=1,
        description="Sort keys of free vehicles, if vehicles choose.",
    )
    vehicle_candidates: list[CandidateKey] = Field(
        [CandidateKey.BY_COMPLETE_ROUTING_COSTS, CandidateKey.BY_VEHICLE_NAME],
        min_length=1,
        description="Sort keys by which an order chooses its vehicle.",
    )
    order_candidates: list[CandidateKey] = Field(
        [CandidateKey.BY_PRIORITY, CandidateKey.BY_DEADLINE, CandidateKey.BY_AGE],
        min_length=1,
        description="Sort keys by which a vehicle chooses its order; only with SCARCER.",
    )
    failed_orders: int = Field(
        3,
        ge=0,
        le=100,
        description="Orders that may fail in a row at a vehicle; then it gets no more until a person sets "
        "its integration level, or it has finished a drive. 0: no limit.",
    )
    deadline_at_risk: float = Field(
        60.0, ge=0, description="Time before its deadline from which an order is at risk, seconds."
    )
    loads_respected: bool = Field(
        default=True,
        description="Vehicles without room for another load take no orders that begin with a pick. Set to "
        "false for robots that report loads incorrectly.",
    )
    maps_respected: bool = Field(
        default=True,
        description="Vehicles whose robot does not report their map as enabled take no orders. Set to false "
        "for robots that use other map IDs in maps than in their position.",
    )
    energy: EnergySettings = Field(default_factory=EnergySettings, description="Energy of vehicles.")
    recharging: RechargingSettings = Field(
        default_factory=RechargingSettings, description="Recharging of idle vehicles."
    )
    parking: ParkingSettings = Field(default_factory=ParkingSettings, description="Parking of idle vehicles.")
