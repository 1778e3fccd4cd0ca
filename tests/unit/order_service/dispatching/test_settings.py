from __future__ import annotations

import pytest
from pydantic import ValidationError

from nena_order_service.dispatching.settings import DispatchSettings, EnergySettings
from nena_shared.plant.model import EnergyThresholds


def test_vehicles_that_the_plant_model_lacks_have_the_thresholds_that_it_would_give() -> None:
    assert EnergySettings().thresholds == EnergyThresholds()


def test_crossed_thresholds_are_refused() -> None:
    with pytest.raises(ValidationError, match="crossed energy thresholds"):
        EnergySettings(critical=50, good=40)


@pytest.mark.parametrize("keys", ["orders", "vehicles", "vehicle_candidates", "order_candidates"])
def test_no_list_of_keys_is_empty(keys: str) -> None:
    with pytest.raises(ValidationError, match=keys):
        DispatchSettings.model_validate({keys: []})


def test_nobody_parks_or_recharges_unless_that_is_switched_on() -> None:
    settings = DispatchSettings()
    assert not settings.parking.enabled
    assert not settings.recharging.enabled
