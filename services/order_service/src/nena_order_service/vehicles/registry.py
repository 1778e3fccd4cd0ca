"""The vehicles: those of the plant model, and discovered robots; and the maps of robots."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from nena_order_service.fleet.position import RobotProfile, max_distance_m
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.vehicle import RobotMap
from nena_shared.plant import PlantModel, Vehicle
from nena_shared.plant.model import map_transforms
from nena_shared.vda5050.state import MapStatus, State
from nena_shared.vda5050.topics import DEFAULT_MANUFACTURER, RobotKey

R = ReasonCode


@dataclass(frozen=True, slots=True)
class FleetVehicle:
    """One vehicle: its name for hosts, and its robot."""

    name: str
    key: RobotKey
    profile: RobotProfile
    model: Vehicle | None
    """Its data in the plant model; None: it is not in the model."""
    obstacle: Reason | None = None
    """Why it never gets orders, as a predicate; None if it may."""


class VehicleRegistry:
    """The vehicles by name and by robot key.

    By default, a vehicle is the robot of manufacturer ``NeNa`` with the vehicle's name as its serial number.
    """

    def __init__(
        self,
        plant: PlantModel,
        *,
        default_map_id: str,
        adopt_unknown: bool,
        max_distance: float | None = None,
    ) -> None:
        """``max_distance``: m from the nearest point beyond which positions count as wrong; None: default."""
        self._default_map_id = default_map_id
        self._adopt_unknown = adopt_unknown
        self._by_name: dict[str, FleetVehicle] = {}
        self._by_key: dict[RobotKey, FleetVehicle] = {}
        self.map_ids = {default_map_id} if default_map_id else set[str]()
        """The maps on which the vehicles of the plant model drive."""
        self._transforms = map_transforms(plant)
        self._max_distance_m = max_distance_m(plant) if max_distance is None else max_distance
        self._names: frozenset[str] | None = None
        for vehicle in plant.vehicles:
            self._add_vehicle(self._of_plant(vehicle))

    def __iter__(self) -> Iterator[FleetVehicle]:
        """Yield all vehicles, those of the plant model first."""
        return iter(tuple(self._by_name.values()))

    def names(self) -> frozenset[str]:
        """Return the names of the vehicles that may get orders; cached, because each order needs them."""
        if self._names is None:
            self._names = frozenset(vehicle.name for vehicle in self if not vehicle.obstacle)
        return self._names

    def model(self, name: str) -> Vehicle | None:
        """Return the plant model's data of a vehicle; None if it has none."""
        vehicle = self._by_name.get(name)
        return vehicle.model if vehicle else None

    def named(self, name: str | None) -> FleetVehicle | None:
        """Return the vehicle of this name; None if there is none."""
        return None if name is None else self._by_name.get(name)

    def employed(self, name: str | None) -> FleetVehicle | None:
        """Return the vehicle of this name if it may have orders; None: it may not, or does not exist."""
        vehicle = self.named(name)
        return None if vehicle is None or vehicle.obstacle else vehicle

    def of(self, key: RobotKey) -> FleetVehicle | None:
        """Return the vehicle that is this robot; None if it was never discovered."""
        return self._by_key.get(key)

    def discover(self, key: RobotKey) -> FleetVehicle:
        """Return the vehicle that is this robot; add it if it is new."""
        vehicle = self._by_key.get(key)
        if vehicle:
            return vehicle
        obstacle = None if self._adopt_unknown else Reason(R.NOT_IN_PLANT)
        profile = RobotProfile(
            map_id=self._default_map_id, transforms=self._transforms, max_distance_m=self._max_distance_m
        )
        # VDA 5050: a serial number is unique only with its manufacturer; hosts know one name for both.
        is_taken = key.serial_number in self._by_name
        name = f"{key.manufacturer}-{key.serial_number}" if is_taken else key.serial_number
        return self._add_vehicle(FleetVehicle(name, key, profile, None, obstacle))

    def learn_map(self, vehicle: FleetVehicle, map_id: str) -> FleetVehicle:
        """Put a vehicle without a configured map on the one that its robot reports."""
        if vehicle.profile.map_id:
            return vehicle
        return self._add_vehicle(replace(vehicle, profile=replace(vehicle.profile, map_id=map_id)))

    def learn_frame(self, vehicle: FleetVehicle, *, transforms_itself: bool) -> None:
        """Note from a robot's factsheet whether it uses the plant's frame."""
        # The plant's transform must not be applied twice: such a robot reports and expects the plant's frame.
        if vehicle.profile.transforms_itself is not transforms_itself:
            self._add_vehicle(
                replace(vehicle, profile=replace(vehicle.profile, transforms_itself=transforms_itself))
            )

    def _of_plant(self, vehicle: Vehicle) -> FleetVehicle:
        key = RobotKey(vehicle.manufacturer or DEFAULT_MANUFACTURER, vehicle.serial_number or vehicle.name)
        profile = RobotProfile.of(
            vehicle,
            default_map_id=self._default_map_id,
            transforms=self._transforms,
            max_distance_m=self._max_distance_m,
        )
        return FleetVehicle(vehicle.name, key, profile, vehicle)

    def _add_vehicle(self, vehicle: FleetVehicle) -> FleetVehicle:
        self._by_name[vehicle.name] = vehicle
        self._by_key[vehicle.key] = vehicle
        self._names = None
        if vehicle.model and vehicle.profile.map_id:
            self.map_ids.add(vehicle.profile.map_id)
        return vehicle


def robot_maps(state: State) -> tuple[RobotMap, ...] | None:
    """Return the maps of a robot; None if it reports none."""
    if state.maps is None:
        return None
    return tuple(
        RobotMap(
            map_id=robot_map.map_id,
            map_version=robot_map.map_version,
            enabled=robot_map.map_status is MapStatus.ENABLED,
        )
        for robot_map in state.maps
    )


def why_not_on(map_id: str, state: State) -> Reason | None:
    """Return, as a predicate, why a robot cannot drive on a map; None if it can, or reports no maps."""
    # VDA 5050 2.1: maps are optional in the state; a robot that reports none is not held to them.
    if not state.maps or not map_id:
        return None
    versions = [robot_map for robot_map in state.maps if robot_map.map_id == map_id]
    if any(version.map_status is MapStatus.ENABLED for version in versions):
        return None
    return Reason(R.NO_MAP_ENABLED if versions else R.NO_MAP, map=map_id)
