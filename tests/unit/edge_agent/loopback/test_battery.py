from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_edge_agent.loopback.battery import Battery
from nena_edge_agent.loopback.settings import LoopbackSettings

STEPS = st.lists(
    st.tuples(st.sampled_from(["drive", "on", "off", "wait", "set"]), st.floats(0, 1000)), max_size=20
)


def battery(**settings: float) -> Battery:
    return Battery(LoopbackSettings.model_validate(settings))


def test_driving_takes_charge() -> None:
    one = battery(charge=50, drain=2)
    one.drive(300)

    assert one.level(0.0) == 44
    one.drive(10_000)
    assert one.level(0.0) == 0


def test_charging_gives_it_back_until_it_is_full() -> None:
    one = battery(charge=50, charge_rate=2)
    one.switch(10.0, charging=True)

    assert one.charging
    assert (one.level(15.0), one.level(15.0)) == (60, 60)
    assert one.level(100.0) == 100
    one.switch(100.0, charging=False)
    one.drive(100)
    assert one.level(200.0) == 99


def test_a_level_that_is_set_counts_from_then_on() -> None:
    one = battery(charge=50, charge_rate=1)
    one.switch(0.0, charging=True)
    one.set_level(10.0, 5)

    assert one.level(12.0) == pytest.approx(7)


@given(STEPS)
def test_its_charge_is_always_a_percentage(steps: list[tuple[str, float]]) -> None:
    one, now = battery(), 0.0
    for kind, value in steps:
        now += value
        match kind:
            case "drive":
                one.drive(value)
            case "on" | "off":
                one.switch(now, charging=kind == "on")
            case "set":
                one.set_level(now, min(value, 100.0))
        assert 0 <= one.level(now) <= 100
