from __future__ import annotations

from nena_edge_agent.driver.map_port import MapGoal, MapPose
from nena_edge_agent.ros.way_driven import WayDriven


def place(x: float, y: float = 0.0, theta: float = 0.0) -> MapPose:
    return MapPose(x, y, theta, "hall")


def goal(*xs: float) -> MapGoal:
    first, *rest = (place(x) for x in xs)
    return MapGoal(1, first, deviation_xy=0.3, ahead=tuple(rest))


def test_covers_what_is_left_of_its_way_whatever_the_headings() -> None:
    way = WayDriven()
    way.begin(goal(1.0, 2.0, 3.0))
    assert way.covers(goal(2.0, 3.0))
    assert way.covers(MapGoal(2, place(3.0, theta=1.0), deviation_xy=0.3))
    assert not way.covers(goal(2.0, 3.0, 4.0))
    assert not way.covers(goal(2.0))
    assert not way.covers(goal(0.0, 1.0, 2.0, 3.0))


def test_a_single_place_is_no_way() -> None:
    way = WayDriven()
    way.begin(goal(1.0))
    assert not way.covers(goal(1.0))


def test_a_place_that_is_let_go_and_turned_away_from_is_missed() -> None:
    way, wanted = WayDriven(), goal(5.0, 10.0)
    way.begin(wanted)
    assert not way.missed(wanted, place(4.0, 1.0))
    way.left(wanted, 2)
    assert not way.missed(wanted, place(2.0, 1.0))
    way.left(wanted, 1)
    assert not way.missed(wanted, place(4.5, 0.6))
    assert not way.missed(wanted, place(5.0, 0.6))
    assert way.missed(wanted, place(6.0, 0.6))


def test_a_place_that_was_met_is_not_missed() -> None:
    way, wanted = WayDriven(), goal(5.0, 10.0)
    way.begin(wanted)
    way.left(wanted, 1)
    assert not way.missed(wanted, place(5.0, 0.2))
    assert not way.missed(wanted, place(7.0))


def test_each_place_is_looked_at_for_itself() -> None:
    way = WayDriven()
    way.begin(goal(5.0, 10.0, 15.0))
    way.left(goal(5.0, 10.0, 15.0), 2)
    assert not way.missed(goal(5.0, 10.0, 15.0), place(5.0, 0.6))
    way.go_on()
    assert not way.missed(goal(10.0, 15.0), place(7.0))
