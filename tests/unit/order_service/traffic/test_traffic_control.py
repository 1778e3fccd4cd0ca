"""Who may begin, who must wait and who must make room."""

from __future__ import annotations

from nena_order_service.traffic.traffic_control import Wish
from nena_shared.plant import PlantModel
from nena_shared.plant.point import Point, PointType
from support.plants import path, plant
from support.traffic.scenes import Scene

BOTH_WAYS = 1000


def parking(model: PlantModel, *names: str) -> PlantModel:
    """Make these points parking positions."""
    points = tuple(
        Point(name=each.name, x_mm=0, y_mm=0, type=PointType.PARK_POSITION) if each.name in names else each
        for each in model.points
    )
    return model.model_copy(update={"points": points})


def tracks(*ends: str) -> PlantModel:
    return plant(*(path(each, max_reverse_velocity_mm_s=BOTH_WAYS) for each in ends))


def test_a_wish_is_granted_where_the_way_is_free() -> None:
    scene = Scene(tracks("A B", "B C"), v="A")
    scene.control.wish(Wish("v", "C"))

    assert list(scene.decide()) == ["Departure v A B C"]
    assert list(scene.decide()) == []
    assert [each.point for each in scene.scheduler.occupant("v").claimed] == ["B", "C"]


def test_who_rests_in_the_way_goes_to_a_parking_place_though_others_are_nearer() -> None:
    scene = Scene(parking(tracks("A B", "B C", "B X", "B Y", "Y P"), "P"), v="A", w="B")
    scene.control.wish(Wish("v", "C"))

    assert list(scene.decide()) == ["Evasion w B Y P"]
    assert str(scene.control.why_waiting("v")) == "waits for 'B', where w rests"
    scene.drive_to_end("w")
    assert list(scene.decide()) == ["Departure v A B C"]
    assert scene.control.why_waiting("v") is None


def test_who_works_where_it_stands_is_waited_for() -> None:
    scene = Scene(tracks("A B", "B C", "B X"), v="A", w="B")
    scene.control.wish(Wish("v", "C"))

    assert list(scene.decide("w")) == []
    assert str(scene.control.why_waiting("v")) == "waits for 'B', where w rests"


def test_a_short_detour_around_somebody_who_rests_is_taken_and_a_long_one_is_not() -> None:
    short = Scene(
        plant(path("A B", 1000), path("B C", 1000), path("A X", 1400), path("X C", 1400)), v="A", w="B"
    )
    short.control.wish(Wish("v", "C"))
    assert list(short.decide("w")) == ["Departure v A X C"]

    long = Scene(
        plant(path("A B", 1000), path("B C", 1000), path("A X", 2000), path("X C", 2000)), v="A", w="B"
    )
    long.control.wish(Wish("v", "C"))
    assert list(long.decide("w")) == []


def test_whether_others_would_have_to_make_room_is_known_before_anybody_is_asked_to() -> None:
    scene = Scene(plant(path("A B", 1000), path("B C", 1000), path("C D", 1000)), v="A", w="B")
    assert scene.control.displaces(Wish("v", "C"))
    assert scene.control.displaces(Wish("v", "B"))
    assert not scene.control.displaces(Wish("w", "D"))
    assert not scene.control.displaces(Wish("w", "A")), "no way leads there"
    assert list(scene.decide()) == []


def test_nobody_has_to_make_room_where_a_short_detour_leads_around() -> None:
    for length, displaces in ((1400, False), (2000, True)):
        around = path("A X", length), path("X C", length)
        scene = Scene(plant(path("A B", 1000), path("B C", 1000), *around), v="A", w="B")
        assert scene.control.displaces(Wish("v", "C")) == displaces

    both = Scene(
        plant(path("A B", 1000), path("B C", 1000), path("A X", 1000), path("X C", 1000)),
        v="A",
        w="B",
        u="X",
    )
    assert both.control.displaces(Wish("v", "C"))


def test_somebody_who_comes_to_rest_in_the_way_would_have_to_make_room_too() -> None:
    scene = Scene(tracks("A B", "B C", "B D"), v="A", w="D")
    assert not scene.control.displaces(Wish("v", "C"))
    scene.control.wish(Wish("w", "B"))
    assert list(scene.decide()) == ["Departure w D B"]
    assert scene.control.displaces(Wish("v", "C"))


def test_two_who_want_each_others_places_change_them_by_way_of_a_third() -> None:
    scene = Scene(tracks("A B", "B C", "B X"), v="A", w="C")
    scene.control.wish(Wish("v", "C"))
    scene.control.wish(Wish("w", "A"))

    assert list(scene.decide()) == ["Evasion w C B X"]
    scene.drive_to_end("w")
    assert list(scene.decide()) == ["Departure v A B C", "Departure w X B A"]
    scene.drive_to_end("v")
    scene.drive_to_end("w")


def test_somebody_who_is_enclosed_is_let_out_first() -> None:
    scene = Scene(tracks("A B", "B C", "C X", "C Y"), v="A", u="B", w="C")
    scene.control.wish(Wish("v", "B"))

    assert list(scene.decide()) == ["Evasion w C Y"]
    scene.drive_to_end("w")
    assert list(scene.decide()) == ["Evasion u B C"]
    scene.drive_to_end("u")
    assert list(scene.decide()) == ["Departure v A B"]


def test_nobody_comes_to_rest_on_the_way_of_the_one_who_has_waited_longest() -> None:
    scene = Scene(tracks("A B", "B C", "C D", "D E", "E X"), v="A", w="E", u="C")
    scene.control.wish(Wish("v", "D"))
    scene.control.wish(Wish("w", "D"))

    assert list(scene.decide("u")) == []
    assert str(scene.control.why_waiting("w")) == "lets v go first at 'D'"


def test_a_wish_that_is_dropped_is_not_granted() -> None:
    scene = Scene(tracks("A B"), v="A")
    scene.control.wish(Wish("v", "B"))

    scene.control.drop("v")

    assert list(scene.decide()) == []


def test_who_had_its_turn_and_could_not_come_to_its_goal_is_first_again() -> None:
    scene = Scene(tracks("A B", "X B", "B C"), v="A", w="X")
    scene.control.wish(Wish("v", "C"))
    scene.control.wish(Wish("w", "C"), first=True)

    assert scene.control.wishing == ("w", "v")
    assert list(scene.decide()) == ["Departure w X B C"]


def test_around_somebody_who_is_lost_any_detour_is_taken() -> None:
    scene = Scene(
        plant(path("A B", 1000), path("B C", 1000), path("A X", 9000), path("X C", 9000)), v="A", w="B"
    )
    scene.control.wish(Wish("v", "C"))

    granted = list(scene.control.decide(lambda name: name == "v", lambda name: name == "w"))

    assert [each.vehicle for each in granted] == ["v"]
    assert [each.point for each in scene.scheduler.occupant("v").claimed] == ["X", "C"]


def test_who_waits_for_somebody_who_is_lost_keeps_nobody_else_from_anything() -> None:
    scene = Scene(tracks("A B", "B C", "X A", "X Y"), v="Y", w="B", u="A")
    scene.control.wish(Wish("v", "C"))
    scene.control.wish(Wish("u", "X"))

    granted = list(scene.control.decide(lambda name: name != "w", lambda name: name == "w"))

    assert [each.vehicle for each in granted] == ["u"]


def test_a_straight_way_needs_the_point_at_its_end() -> None:
    scene = Scene(tracks("A B"), v="A", w="B")
    scene.control.wish(Wish("v", "B", straight_mm=1500))
    assert list(scene.decide("w")) == []
    assert str(scene.control.why_waiting("v")) == "waits for 'B', where w rests"

    scene.scheduler.remove("w")
    assert list(scene.decide()) == ["Departure v "]
    assert [each.length_mm for each in scene.scheduler.occupant("v").claimed] == [1500]


def test_a_location_is_one_vehicles_also_where_that_stands_there_already() -> None:
    scene = Scene(tracks("A B"), v="A", w="B")
    scene.control.wish(Wish("v", "A", location="Shelf"))
    scene.control.wish(Wish("w", "B", location="Shelf"))

    assert list(scene.decide()) == ["Departure v A"]
    assert str(scene.control.why_waiting("w")) == "lets v go first at 'Shelf'"
    assert scene.allocate("v") == ""
    assert list(scene.decide("v")) == []
