"""How much of its way a robot is given at a time, and what others leave to it."""

from __future__ import annotations

import pytest

from nena_order_service.api.orders import OrderOperations
from nena_order_service.api.vehicles import VehicleOperations
from nena_order_service.engine.context import EngineSettings
from nena_order_service.engine.driving import RELOCATION_PAUSE
from nena_order_service.engine.engine import Engine
from nena_order_service.errors import RefusedError
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.fleet_api.requests import InstantActionRequest
from nena_shared.fleet_api.transport_order import TransportOrderRequest
from nena_shared.plant import PlantModel, Vehicle
from support.order_service import request
from support.plants import path, point
from support.scripted_fleet import MemoryStore, ScriptedFleet, key, make_engine, reason_of, status_of

pytestmark = pytest.mark.clause("6.1.2/fleet", "6.6.3/fleet")

PLANT = PlantModel(
    name="row",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("ABCDE")),
    paths=(path("A B"), path("B C"), path("C D"), path("D E")),
    vehicles=(Vehicle(name="V1"),),
)


def base(vda_order: VdaOrder) -> list[str]:
    return [node.node_id for node in vda_order.nodes if node.released]


async def under_way(store: MemoryStore, fleet: ScriptedFleet, ahead: int) -> Engine:
    engine = await make_engine(PLANT, store, fleet, release_ahead=ahead)
    fleet.appear("V1", "A")
    engine.create(request("E", name="T-1"), "T-1")
    return engine


async def test_without_limits_the_whole_route_is_the_base() -> None:
    store, fleet = MemoryStore(), ScriptedFleet({})
    await under_way(store, fleet, 0)
    fleet.pass_node("V1", 0)
    fleet.want_base("V1")

    assert [base(vda_order) for _, vda_order in fleet.sent] == [["A", "B", "C", "D", "E"]]
    assert fleet.extended == []


@pytest.mark.parametrize(
    ("speed_mm_s", "released"),
    [(1000, ["A", "B", "C"]), (1500, ["A", "B", "C", "D"])],  # 1 m and 1.5 m behind the next node
)
async def test_the_base_covers_the_distance_driven_in_a_second(speed_mm_s: int, released: list[str]) -> None:
    vehicles = (Vehicle(name="V1", max_velocity_mm_s=speed_mm_s),)
    fleet, settings = ScriptedFleet({}), EngineSettings(default_map_id="map")
    plant = PLANT.model_copy(update={"vehicles": vehicles})
    engine = await make_engine(plant, MemoryStore(), fleet, settings=settings)
    fleet.appear("V1", "A")
    engine.create(request("E", name="T-1"), "T-1")

    assert [base(vda_order) for _, vda_order in fleet.sent] == [released]
    assert len(fleet.sent[0][1].nodes) == 5


async def test_a_new_base_request_extends_the_base_by_one_node() -> None:
    fleet, settings = ScriptedFleet({}), EngineSettings(default_map_id="map")
    engine = await make_engine(PLANT, MemoryStore(), fleet, settings=settings)
    fleet.appear("V1", "A")
    engine.create(request("E", name="T-1"), "T-1")
    fleet.want_base("V1")

    assert [base(vda_order) for _, vda_order in fleet.extended] == [["A", "B", "C", "D"]]


async def test_release_ahead_nodes_are_released_ahead_of_the_robot() -> None:
    store, fleet = MemoryStore(), ScriptedFleet({})
    await under_way(store, fleet, 2)
    assert [base(vda_order) for _, vda_order in fleet.sent] == [["A", "B", "C"]]
    assert len(fleet.sent[0][1].nodes) == 5

    for index in range(4):
        fleet.pass_node("V1", index)

    assert [base(vda_order) for _, vda_order in fleet.extended] == [
        ["A", "B", "C", "D"],
        ["A", "B", "C", "D", "E"],
    ]


async def test_an_early_new_base_request_extends_the_base() -> None:
    store, fleet = MemoryStore(), ScriptedFleet({})
    await under_way(store, fleet, 1)

    fleet.want_base("V1")

    assert [base(vda_order) for _, vda_order in fleet.extended] == [["A", "B", "C"]]


async def test_the_base_of_a_withdrawn_order_is_not_extended() -> None:
    store, fleet = MemoryStore(), ScriptedFleet({})
    engine = await under_way(store, fleet, 1)
    (number,) = [order.number for order in store.found.orders]
    engine.withdraw(number, "no longer wanted")

    fleet.pass_node("V1", 1)
    fleet.want_base("V1")

    assert fleet.extended == []


async def test_after_a_restart_the_robot_continues_its_order() -> None:
    store, fleet = MemoryStore(), ScriptedFleet({})
    await under_way(store, fleet, 1)
    fleet.pass_node("V1", 1)
    fleet.pass_node("V1", 2)
    again = ScriptedFleet({"V1": "C"})

    await make_engine(PLANT, store, again, release_ahead=1)
    assert base(again.missions[key("V1")]) == ["A", "B", "C", "D"]
    assert again.updates == {"V1": 2}
    again.pass_node("V1", 3)

    assert [base(vda_order) for _, vda_order in again.extended] == [["A", "B", "C", "D", "E"]]


async def test_a_robot_is_sent_only_speeds_of_the_plant_model() -> None:
    paths = (path("A B", max_velocity_mm_s=300), path("B C"), path("C D", max_velocity_mm_s=800))
    vehicle = Vehicle(name="V1", max_reverse_velocity_mm_s=200)
    fleet = ScriptedFleet({})
    plant = PLANT.model_copy(update={"paths": paths, "vehicles": (vehicle,)})
    engine = await make_engine(
        plant, MemoryStore(), fleet, settings=EngineSettings(default_map_id="map", speed_limits=True)
    )
    fleet.appear("V1", "A")

    engine.create(request("D", name="T-1"), "T-1")

    ((_, vda_order),) = fleet.sent
    assert [each.maximum_speed for each in vda_order.edges] == [0.3, None, 0.8]


@pytest.mark.parametrize(("sent", "speeds"), [(True, [0.3, 0.6]), (False, [None, None])])
async def test_a_robot_is_sent_its_speed_limits(sent: bool, speeds: list[float | None]) -> None:  # noqa: FBT001
    store, fleet = MemoryStore(), ScriptedFleet({})
    paths = (path("A B", max_velocity_mm_s=300), path("B C", max_velocity_mm_s=800))
    slow = Vehicle(name="V1", max_velocity_mm_s=600)
    plant = PLANT.model_copy(update={"paths": paths, "vehicles": (slow,)})
    settings = EngineSettings(default_map_id="map", speed_limits=sent)
    engine = await make_engine(plant, store, fleet, settings=settings)
    fleet.appear("V1", "A")

    engine.create(request("C", name="T-1"), "T-1")

    ((_, vda_order),) = fleet.sent
    assert [each.maximum_speed for each in vda_order.edges] == speeds


TRACK = PlantModel(
    name="single track",
    points=tuple(point(name, 2000 * index) for index, name in enumerate("ABCDP")),
    paths=tuple(path(ends, 2000, max_reverse_velocity_mm_s=1000) for ends in ("A B", "B C", "C D", "B P")),
    vehicles=(Vehicle(name="V1"), Vehicle(name="V2")),
)


async def two(store: MemoryStore, fleet: ScriptedFleet, ahead: int = 0) -> Engine:
    engine = await make_engine(TRACK, store, fleet, release_ahead=ahead)
    for name, at in tuple(fleet.at.items()):
        fleet.appear(name, at)
    return engine


def reason(engine: Engine, name: str) -> str:
    return status_of(engine, name).reason


async def test_a_robot_waits_for_resources_of_another_with_a_reason() -> None:
    fleet = ScriptedFleet({"V1": "A", "V2": "C"})
    engine = await two(MemoryStore(), fleet)
    engine.create(request("D", intendedVehicle="V2"), "T-2")
    engine.create(request("C", intendedVehicle="V1"), "T-1")

    assert [base(vda_order) for _, vda_order in fleet.sent] == [["C", "D"], ["A", "B"]]
    assert len(fleet.missions[key("V1")].nodes) == 3
    assert reason(engine, "T-1").endswith("but it waits for V2, which passes 'C' first")

    fleet.finish("V2")
    assert [base(vda_order) for _, vda_order in fleet.extended] == [["A", "B", "C"]]
    assert reason(engine, "T-1") == "robot V1 travels to destination 1 of 1"


async def test_a_robot_that_rests_in_the_way_makes_room_without_an_order() -> None:
    store, fleet = MemoryStore(), ScriptedFleet({"V1": "A", "V2": "B"})
    engine = await two(store, fleet)
    engine.create(request("C", intendedVehicle="V1"), "T-1")

    ((robot, evasion),) = fleet.sent
    assert (robot, base(evasion)) == ("V2", ["B", "P"])
    assert evasion.order_id.startswith("evasion-")
    assert reason(engine, "T-1").endswith("but it waits for V2, which stands on 'B'")
    assert (
        engine.reporter.vehicle_status(engine.registry.discover(key("V2"))).reason == "makes room for others"
    )

    vehicles = VehicleOperations(engine, OrderOperations(engine))
    shutdown = InstantActionRequest(action_type="shutdown")
    with pytest.raises(RefusedError, match="'V2' makes room for another vehicle"):
        await vehicles.send_instant_action("V2", shutdown)

    again = ScriptedFleet({"V1": "A", "V2": "B"})
    restarted = await make_engine(TRACK, store, again)
    assert again.adopted == [("V2", evasion.order_id, False)]
    for name in ("V1", "V2"):
        again.appear(name, again.at[name])
    again.accept("V2")
    assert again.finish("V2")
    assert again.finish("V1")
    assert status_of(restarted, "T-1").state.final


async def test_a_failed_evasion_is_retried_later() -> None:
    fleet = ScriptedFleet({"V1": "A", "V2": "B"})
    engine = await two(MemoryStore(), fleet)
    engine.create(request("C", intendedVehicle="V1"), "T-1")
    fleet.fail("V2")
    assert len(fleet.sent) == 1

    engine.clock.advance(RELOCATION_PAUSE)  # type: ignore[attr-defined] # the clock of make_engine
    engine.run_checks()

    assert [robot for robot, _ in fleet.sent] == ["V2", "V2"]


async def test_a_regular_withdrawal_ends_at_the_end_of_the_base() -> None:
    store, fleet = MemoryStore(), ScriptedFleet({})
    engine = await under_way(store, fleet, 2)
    (order,) = store.found.orders
    engine.withdraw(order.number, "no longer wanted", immediate=False)

    ((_, update),) = fleet.extended
    assert [node.node_id for node in update.nodes] == base(update) == ["A", "B", "C"]
    assert fleet.cancelled == []
    assert engine.traffic.route_of("V1").all_allocated  # type: ignore[union-attr] # it is there

    assert fleet.finish("V1")
    assert reason(engine, "T-1").startswith("withdrawn")


async def test_unsent_orders_are_withdrawn_at_once() -> None:
    fleet = ScriptedFleet({"V1": "A", "V2": "B"})
    engine = await two(MemoryStore(), fleet)
    order = engine.create(request("C", intendedVehicle="V1"), "T-1")
    assert [robot for robot, _ in fleet.sent] == ["V2"]

    engine.withdraw(order.number, "no longer wanted")

    assert reason(engine, "T-1") == "withdrawn before the robot had started: no longer wanted"
    assert (
        engine.reporter.vehicle_status(engine.registry.discover(key("V1"))).reason
        == "idle: no waiting orders"
    )


async def test_a_cancelled_robot_keeps_what_it_held_until_it_is_seen_standing() -> None:
    fleet = ScriptedFleet({"V1": "A", "V2": "D"})
    engine = await two(MemoryStore(), fleet)
    order = engine.create(request("C", intendedVehicle="V1"), "T-1")
    engine.create(request("B", intendedVehicle="V2"), "T-2")
    fleet.fields["V1"] = {"driving": True}
    engine.withdraw(order.number, "not wanted")
    fleet.confirm_cancel("V1")

    assert {each.point for each in engine.traffic.held_by("V1")} >= {"A", "B", "C"}
    assert (
        "not been seen standing" in engine.reporter.vehicle_status(engine.registry.discover(key("V1"))).reason
    )
    assert not any(robot == "V2" for robot, _ in fleet.sent)

    fleet.fields.clear()
    fleet.appear("V1", "A")
    assert [each.point for each in engine.traffic.held_by("V1")] == ["A"]
    assert fleet.finish("V2")


async def test_vehicles_under_way_drive_around_a_lost_robot() -> None:
    ring = PlantModel(
        name="ring",
        points=tuple(point(name, 2000 * index) for index, name in enumerate("ABCDEFG")),
        paths=tuple(
            path(ends, 2000, max_reverse_velocity_mm_s=1000)
            for ends in ("A B", "B C", "C D", "B E", "E F", "F D", "D G")
        ),
        vehicles=TRACK.vehicles,
    )
    fleet = ScriptedFleet({"V1": "A", "V2": "B"})
    engine = await make_engine(ring, MemoryStore(), fleet, release_ahead=1)
    for name, at in tuple(fleet.at.items()):
        fleet.appear(name, at)
    engine.create(request("G", intendedVehicle="V2"), "T-2")
    engine.create(request("D", intendedVehicle="V1"), "T-1")
    fleet.at["V2"] = "C"
    fleet.pass_node("V2", 1)
    assert base(fleet.missions[key("V1")]) == ["A", "B"]
    fleet.fields["V2"] = {"operating_mode": "MANUAL"}
    fleet.out_of_order.add("V2")
    fleet.fail("V2")

    assert fleet.finish("V1")
    assert fleet.sent[-1][1].order_id == "T-1-0~1"
    assert base(fleet.missions[key("V1")]) == ["B", "E"]
    assert reason(engine, "T-2").startswith("wheel lost")


async def test_a_robot_sent_to_a_coordinate_far_from_all_points_goes_on_from_there() -> None:
    fleet = ScriptedFleet({})
    engine = await make_engine(PLANT, MemoryStore(), fleet)

    def at(y: float, node: str) -> None:
        pose = {"x": 0.0, "y": y, "theta": 0.0, "map_id": "map", "localized": True}
        fleet.fields["V1"] = {"mobile_robot_position": pose}
        fleet.appear("V1", node)

    at(0.0, "A")
    destinations = [{"coordinate": {"x": 0.0, "y": 40.0}, "operation": "MOVE"}, {"locationName": "C"}]
    engine.create(TransportOrderRequest.model_validate({"destinations": destinations}), "T-1")
    at(20.0, "A")
    assert reason_of(engine) == "robot V1 travels to destination 1 of 2"

    at(40.0, "A")
    fleet.finish("V1")

    assert base(fleet.sent[-1][1]) == ["start:T-1-1", "A", "B", "C"]
