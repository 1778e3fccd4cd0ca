from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from nena_order_service.engine.state import VehicleRecord
from nena_order_service.engine.status import essentials, vehicle_status
from nena_order_service.fleet.position import RobotProfile
from nena_order_service.fleet.robot import Availability, LinkStatus, RobotView
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.vehicle import (
    ANY_ORDER_TYPE,
    IntegrationLevel,
    ProcessingState,
    VehicleState,
    VehicleStatus,
)
from nena_shared.plant import MapPlace, MapTransform, PlantModel, PlantPlace, Vehicle
from nena_shared.vda5050.topics import RobotKey
from support.fleet_examples import state
from support.plants import point

PLANT = PlantModel(
    name="two",
    points=(point("A"), point("B", 5000)),
    vehicles=(
        Vehicle(
            name="Tug",
            properties={"vda5050:manufacturer": "ACME", "vda5050:serialNumber": "7", "vda5050:mapId": "hall"},
        ),
        Vehicle(name="Plain"),
    ),
)


def registry(*, adopt_unknown: bool = False) -> VehicleRegistry:
    return VehicleRegistry(PLANT, default_map_id="", adopt_unknown=adopt_unknown)


def test_vehicles_of_the_plant_are_known_by_name_and_robot() -> None:
    found = registry()
    tug = found.of(RobotKey("ACME", "7"))
    assert tug is not None
    assert (tug.name, tug.profile.map_id) == ("Tug", "hall")
    assert found.named("Plain") == found.of(RobotKey("NeNa", "Plain"))
    assert found.discover(RobotKey("ACME", "7")) is tug
    assert found.names() == {"Tug", "Plain"}


def test_robot_outside_the_plant_is_listed_but_gets_no_orders() -> None:
    found = registry()
    assert found.discover(RobotKey("X", "9")).name == "9"
    assert [vehicle.name for vehicle in found] == ["Tug", "Plain", "9"]
    assert "9" not in found.names()
    assert "9" in registry_with_stranger().names()


def registry_with_stranger() -> VehicleRegistry:
    found = registry(adopt_unknown=True)
    found.discover(RobotKey("X", "9"))
    return found


def test_robots_with_the_same_serial_number_have_different_names() -> None:
    found = registry()
    names = {found.discover(RobotKey(maker, "9")).name for maker in ("X", "Y")}
    assert names == {"9", "Y-9"}


def test_an_unnamed_map_is_learned_from_the_robot() -> None:
    found = registry()
    for name in ("Tug", "Plain"):
        vehicle = found.named(name)
        assert vehicle is not None
        found.learn_map(vehicle, "robot map")
    maps = {vehicle.name: vehicle.profile.map_id for vehicle in found}
    assert maps == {"Tug": "hall", "Plain": "robot map"}


def test_the_factsheet_shows_whether_a_robot_transforms_itself() -> None:
    turned = PLANT.model_copy(update={"properties": {"nena:mapTransform.hall": "rotation=90 x=5"}})
    found = VehicleRegistry(turned, default_map_id="", adopt_unknown=True)

    def tug() -> RobotProfile:
        vehicle = found.named("Tug")
        assert vehicle is not None
        return vehicle.profile

    assert (tug().knows_frame("hall"), tug().knows_frame("cellar")) == (False, True)
    for transforms_itself, x in ((False, 5.0), (True, 0.0)):
        vehicle = found.named("Tug")
        assert vehicle is not None
        found.learn_frame(vehicle, transforms_itself=transforms_itself)
        assert tug().knows_frame("hall")
        assert tug().on("hall").to_map(PlantPlace(0.0, 0.0)) == MapPlace(x, 0.0)
    stranger = found.discover(RobotKey("X", "1")).profile
    assert not stranger.knows_frame("hall")


def view(**fields: Any) -> RobotView:
    key = RobotKey("ACME", "7")
    return RobotView(
        key=key,
        link=LinkStatus.ONLINE,
        vehicle_state=VehicleState.IDLE,
        availability=Availability(can_take_order=True, reason=Reason(ReasonCode.IS_FREE)),
        state=state(robot=key, **fields),
        state_at=0.0,
        factsheet=None,
        malformed=0,
        order_id=None,
        order_phase=None,
        wait_reason=None,
    )


TURNED = RobotProfile(
    "hall", transforms={"hall": MapTransform(scale=2.0, offset_x_m=1.0)}, transforms_itself=False
)


def status(robot: RobotView, *, order: str | None = None, profile: RobotProfile = TURNED) -> VehicleStatus:
    vehicle = FleetVehicle("Tug", robot.key, profile, PLANT.vehicle("Tug"))
    told = essentials(
        vehicle,
        robot,
        plant=PLANT,
        record=VehicleRecord(
            manufacturer="NeNa", serial_number="Tug", integration_level=IntegrationLevel.TO_BE_RESPECTED
        ),
        order_types=ANY_ORDER_TYPE,
        transport_order=order,
        order_sequence=None,
        reason=Reason.of("because"),
    )
    return vehicle_status(vehicle, robot, told, last_state=None)


def pose(x: float, *, localized: bool = True) -> dict[str, Any]:
    return {"x": x, "y": 0.0, "theta": 0.5, "map_id": "hall", "localized": localized}


def test_position_is_published_in_the_plants_frame() -> None:
    told = status(view(mobile_robot_position=pose(11.0)))
    assert told.precise_position is not None
    assert told.precise_position.x == pytest.approx(5.0)
    assert told.current_position == "B"


def test_what_holds_a_robot_is_published() -> None:
    told = status(
        view(
            paused=True,
            safety_state={"active_emergency_stop": "MANUAL", "field_violation": True},
            mobile_robot_position=pose(11.0, localized=False),
        )
    )

    assert (told.active_emergency_stop, told.field_violation, told.paused) == ("MANUAL", True, True)
    assert told.localized is False


def test_position_in_an_unknown_frame_is_not_published() -> None:
    told = status(view(mobile_robot_position=pose(11.0)), profile=replace(TURNED, transforms_itself=None))
    assert (told.precise_position, told.current_position) == (None, None)


def test_untrusted_position_is_not_published() -> None:
    told = status(view(mobile_robot_position=pose(11.0, localized=False)))
    assert (told.precise_position, told.current_position) == (None, None)


def test_last_point_is_reported_between_points() -> None:
    told = status(view(last_node_id="A", mobile_robot_position=pose(5.0)), order="T")
    assert (told.current_position, told.processing_state) == ("A", ProcessingState.PROCESSING_ORDER)


def test_errors_are_described_in_text() -> None:
    error = {"error_type": "WHEEL", "error_level": "FATAL", "error_description": "lost"}
    assert status(view(errors=(error,))).errors == ("FATAL WHEEL: lost",)
