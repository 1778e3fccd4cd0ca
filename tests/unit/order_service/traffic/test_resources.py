"""Which resources each step needs, with its blocks."""

from __future__ import annotations

from nena_order_service.routing import Router
from nena_order_service.traffic.resources import Resources, ResourceSet
from nena_shared.plant import PlantModel
from nena_shared.plant.block import Block, BlockType
from support.plants import path, plant


def sets(model: PlantModel, start: str, end: str, location: str | None = None) -> list[ResourceSet]:
    resources = Resources(model)
    route = Router(model).route(start, end)
    return list(resources.along(route.steps, start=resources.at(start), location=location))


def test_a_step_needs_its_path_and_the_point_at_its_end() -> None:
    model = plant(path("A B", 700), path("B C", 900))

    assert sets(model, "A", "C") == [
        ResourceSet("B", 700, {"A --- B": None, "B": None}),
        ResourceSet("C", 900, {"B --- C": None, "C": None}),
    ]


def test_the_location_belongs_to_the_last_step() -> None:
    first, last = sets(plant(path("A B"), path("B C")), "A", "C", location="Shelf")

    assert "Shelf" not in first.uses
    assert last.uses["Shelf"] is None


def test_a_block_is_needed_as_a_whole_by_each_step_into_it_and_by_a_vehicle_that_stands_in_it() -> None:
    block = Block(name="Crossing", members=("B",))
    model = plant(path("A B"), path("B C"), blocks=(block,))

    first, last = sets(model, "A", "C")

    assert first.uses["Crossing"] is None
    assert "Crossing" not in last.uses
    assert Resources(model).at("B").uses == {"B": None, "Crossing": None}


def test_in_a_same_direction_block_a_vehicle_keeps_the_direction_in_which_it_came_in() -> None:
    block = Block(name="Aisle", type=BlockType.SAME_DIRECTION_ONLY, members=("A --- B", "B --- C", "D"))
    model = plant(
        path("A B", properties={"tcs:blockEntryDirection": "north"}),
        path("B C"),
        path("C D"),
        blocks=(block,),
    )

    first, second, third = sets(model, "A", "D")

    assert first.uses["Aisle"] == "north"
    assert second.uses["Aisle"] == "north"
    assert third.uses["Aisle"] == "north"


def test_without_the_property_the_path_is_the_direction() -> None:
    block = Block(name="Aisle", type=BlockType.SAME_DIRECTION_ONLY, members=("A --- B",))
    model = plant(path("A B", max_reverse_velocity_mm_s=1000), blocks=(block,))

    assert sets(model, "A", "B")[0].uses["Aisle"] == "A --- B"
    assert sets(model, "B", "A")[0].uses["Aisle"] == "A --- B:backward"
