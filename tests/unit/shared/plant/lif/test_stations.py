from __future__ import annotations

from typing import Any

import pytest

from nena_shared.plant.lif.document import Station, StationPosition
from nena_shared.plant.lif.names import Names
from nena_shared.plant.lif.stations import StationMaker
from nena_shared.plant.model import NO_OPERATION
from nena_shared.plant.point import Point
from nena_shared.plant.vehicle_type import BlockingType, TypeAction, VehicleTypeAtPoint
from support.plants import point


def doing(name: str, x_mm: int, *actions_by_type: str) -> Point:
    """Make a point at which each vehicle type does what one text names."""
    uses = tuple(
        VehicleTypeAtPoint(
            vehicle_type_id=f"t{number}",
            actions=tuple(
                TypeAction(action_type=each, blocking_type=BlockingType.HARD) for each in actions.split()
            ),
        )
        for number, actions in enumerate(actions_by_type)
    )
    return point(name, x_mm, vehicle_types=uses)


POINTS = {
    each.name: each
    for each in (doing("A", 1000, "pick", "pick drop"), doing("B", 4001, "drop"), point("C", 0))
}


def maker(*taken: str) -> StationMaker:
    return StationMaker(POINTS, Names([*POINTS, *taken]))


def station(name: str, *nodes: str, **more: Any) -> Station:
    return Station(station_id=name, interaction_node_ids=nodes, **more)


def test_each_link_offers_what_some_type_can_do_there() -> None:
    made = maker()
    location = made.location(station("S", "A", "B", "C", "A"), 3)
    links = {link.point: set(link.allowed_operations) for link in location.links}
    (kind,) = made.types
    assert list(links) == ["A", "B", "C"]
    assert links["A"] == set(kind.allowed_operations)
    assert len(links["A"]) == 2
    assert links["B"] < links["A"]
    assert links["C"] == {NO_OPERATION}, "a link without operations would allow all of the type's"
    assert location.layout.layer_id == 3


def test_stations_with_the_same_operations_are_of_one_type() -> None:
    made = maker()
    types = [made.location(station(*each), 0).type for each in (("S", "A"), ("T", "A", "B"), ("U", "B"))]
    assert types[0] == types[1] != types[2]
    assert [each.name for each in made.types] == [types[0], types[2]]


def test_one_is_called_otherwise_where_its_id_is_taken_and_keeps_its_id() -> None:
    location = maker().location(station("A", "B"), 0)
    assert (location.name, location.properties["lif:id"]) == ("station:A", "A")


@pytest.mark.parametrize(
    ("nodes", "position", "place"),
    [
        ("AB", None, (2500, 0)),
        ("AAB", None, (2500, 0)),
        ("", None, (0, 0)),
        ("AB", StationPosition(x=1.2345, y=-2.0), (1234, -2000)),
    ],
)
def test_where_it_is(nodes: str, position: StationPosition | None, place: tuple[int, int]) -> None:
    location = maker().location(station("S", *nodes, station_position=position), 0)
    assert (location.x_mm, location.y_mm) == place
    assert ("lif:stationPosition" in location.properties) is (position is not None)


def test_what_it_does_not_say_is_no_property() -> None:
    bare = maker().location(station("S"), 0)
    assert bare.properties == {"lif:id": "S"}
    whole = maker().location(
        station("S", station_name="Dock", station_description="by the door", station_height=0.4), 0
    )
    assert whole.properties == {
        "lif:id": "S",
        "lif:name": "Dock",
        "lif:description": "by the door",
        "lif:stationHeight": "0.4",
    }
