"""When vehicles under way come where, as far as that is known."""

from __future__ import annotations

import pytest

from nena_order_service.traffic.forecast import ExpectedDrive, Forecast
from nena_order_service.traffic.resources import ResourceSet


def sets(*names: str) -> tuple[ResourceSet, ...]:
    return tuple(ResourceSet(name, 1000, {name: None}) for name in names)


def test_vehicles_enter_a_free_resource_in_waiting_order() -> None:
    drives = {
        "first": ExpectedDrive(sets("A"), sets("X", "B"), 0, (1.0, 1.0)),
        "second": ExpectedDrive(sets("C"), sets("X", "D"), 0, (1.0, 1.0)),
        "third": ExpectedDrive(sets("E"), sets("X", "F"), 0, (1.0, 1.0)),
    }

    found = Forecast(drives)

    assert found.arrivals("first") == (1.0, 2.0)
    assert found.arrivals("second") == (3.0, 4.0)
    assert found.arrivals("third") == (5.0, 6.0)


def test_two_vehicles_that_block_each_other_have_no_arrivals() -> None:
    found = Forecast(
        {
            "v": ExpectedDrive(sets("A"), sets("B"), 0, (1.0,)),
            "w": ExpectedDrive(sets("B"), sets("A"), 0, (1.0,)),
        }
    )

    assert (found.arrivals("v"), found.arrivals("w")) == ((), ())


@pytest.mark.parametrize(("horizon", "known"), [(2.5, 2), (60.0, 4)])
def test_nothing_is_forecast_beyond_the_horizon(horizon: float, known: int) -> None:
    found = Forecast({"v": ExpectedDrive(sets("A"), sets("B", "C", "D", "E"), 1, (1.0,) * 4)}, horizon)

    assert len(found.arrivals("v")) == known
