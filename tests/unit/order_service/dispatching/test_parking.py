from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.dispatching.parking import Energy
from nena_shared.plant.vehicle import EnergyThresholds

LEVELS = EnergyThresholds(critical=20, good=80, sufficiently_recharged=50, fully_recharged=95)


def energy(level: float, *, charging: bool = False) -> Energy:
    return Energy(level, charging, LEVELS)


@pytest.mark.parametrize(
    ("level", "critical", "degraded"), [(20, True, True), (20.1, False, True), (80.1, False, False)]
)
def test_thresholds_belong_to_the_worse_side(*, level: float, critical: bool, degraded: bool) -> None:
    assert (energy(level).critical, energy(level).degraded) == (critical, degraded)


def test_who_has_too_little_energy_is_restricted_in_words_that_stay() -> None:
    reason = energy(3).restriction(fully=True)
    assert reason == "has to recharge first: its energy is not above 20 %, which is critical"
    assert energy(19).restriction(fully=False) == reason


def test_who_recharges_goes_on_until_it_is_fully_or_sufficiently_recharged() -> None:
    assert "until it has 95 %" in energy(60, charging=True).restriction(fully=True)
    assert energy(60, charging=True).restriction(fully=False) == ""
    assert "until it has 50 %" in energy(49, charging=True).restriction(fully=False)
    assert energy(95, charging=True).restriction(fully=True) == ""


def test_who_is_called_away_from_recharging_is_above_the_critical_level() -> None:
    even = Energy(30, charging=True, thresholds=EnergyThresholds())
    assert even.restriction(fully=False)
    assert not even.recharged(fully=False)


thresholds = st.tuples(*[st.integers(0, 100)] * 4).map(
    lambda four: EnergyThresholds(
        critical=min(four[:2]),
        good=max(four[:2]),
        sufficiently_recharged=min(four[2:]),
        fully_recharged=max(four[2:]),
    )
)


@given(level=st.floats(0, 100), charging=st.booleans(), levels=thresholds)
def test_more_energy_never_restricts_more(*, level: float, charging: bool, levels: EnergyThresholds) -> None:
    one, more = Energy(level, charging, levels), Energy(min(100.0, level + 5), charging, levels)
    for fully in (False, True):
        assert one.restriction(fully=fully) or not more.restriction(fully=fully)
    assert not one.restriction(fully=True) or one.critical or charging
    assert one.restriction(fully=True) or not one.restriction(fully=False)
