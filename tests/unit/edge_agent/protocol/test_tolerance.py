"""Whether a robot is where a node wants it."""

from __future__ import annotations

from math import pi

import pytest

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.protocol.tolerance import heading_fits, in_place, radius, same_place, turn
from nena_shared.vda5050.order import AllowedDeviationXY
from support.robot_core import MAP, position


@pytest.mark.clause("7.3/deviation")
def test_an_ellipse_is_turned_by_its_angle() -> None:
    place = position(0.0).model_copy(
        update={"allowed_deviation_xy": AllowedDeviationXY(a=2.0, b=0.5, theta=pi / 2)}
    )

    assert in_place(Pose(0.0, 1.9, 0.0, MAP), place, 0.1)
    assert not in_place(Pose(1.9, 0.0, 0.0, MAP), place, 0.1)
    assert radius(place, 0.1) == 0.5


def test_another_map_is_another_place() -> None:
    assert not in_place(Pose(0.0, 0.0, 0.0, "cellar"), position(0.0), 10.0)


@pytest.mark.clause("7.3/deviation")
def test_no_deviation_means_the_robots_own() -> None:
    assert radius(position(0.0), 0.3) == 0.3
    assert radius(position(0.0, radius=0.0), 0.3) == 0.3


@pytest.mark.clause("7.3/theta")
@pytest.mark.parametrize(("theta", "fits"), [(pi - 0.1, True), (-pi + 0.1, True), (pi - 0.5, False)])
def test_headings_are_compared_across_the_seam(theta: float, fits: bool) -> None:  # noqa: FBT001
    assert heading_fits(Pose(0.0, 0.0, theta, MAP), position(0.0, theta=pi), 0.2) is fits


@pytest.mark.clause("7.3/theta")
def test_without_a_demand_every_heading_fits() -> None:
    assert heading_fits(Pose(0.0, 0.0, 1.0, MAP), position(0.0), 0.1)


def test_the_shortest_turn() -> None:
    assert turn(3.0, -3.0) == pytest.approx(2 * pi - 6.0)
    assert turn(0.0, pi) == pytest.approx(-pi)


def test_a_place_is_the_same_unless_it_asks_for_another_heading() -> None:
    assert same_place(position(1.0), position(1.0))
    assert same_place(position(1.0, theta=1.0), position(1.0))
    assert not same_place(position(1.0), position(1.0, theta=1.0))
    assert not same_place(position(1.0), position(1.1))
