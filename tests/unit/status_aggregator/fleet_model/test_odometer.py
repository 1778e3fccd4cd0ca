from __future__ import annotations

import pytest

from nena_shared.vda5050.brief.state import PositionBrief
from nena_status_aggregator.fleet_model.odometer import Odometer
from support.fleet_briefs import place as at


def driven(*positions: PositionBrief | None) -> float:
    odometer = Odometer()
    for each in positions:
        odometer.follow(each)
    return odometer.meters


def test_ways_add_up() -> None:
    assert driven(at(0, 0), at(3, 4), at(3, 6)) == 7


def test_a_standing_robot_with_noise_does_not_drive_and_a_slow_one_does() -> None:
    assert driven(*(at(0.004 * (number % 2), 0) for number in range(100))) == 0
    assert driven(*(at(0.004 * number, 0) for number in range(101))) == pytest.approx(0.4, abs=0.02)


@pytest.mark.parametrize(
    "jump", [at(100, 0), at(3, 0, map_id="yard"), at(3, 0, localized=False), None], ids=repr
)
def test_what_is_no_drive_does_not_count(jump: PositionBrief | None) -> None:
    assert driven(at(0, 0), at(1, 0), jump) == 1
    assert driven(at(0, 0), jump, at(1, 0), at(2, 0)) in (1, 2)
