from __future__ import annotations

import pytest
from pydantic import ValidationError

from nena_order_service.dispatching.settings import DispatchSettings, EnergySettings
from nena_shared.plant.model import EnergyThresholds


def test_vehicles_outside_the_plant_have_default_thresholds() -> None:
    assert EnergySettings().thresholds == EnergyThresholds()


def test_crossed_thresholds_are_refused() -> None:
    with pytest.raises(ValidationError, match="crossed energy thresholds"):
        EnergySettings(critical=50, good=40)


@pytest.mark.parametrize("keys", ["orders", "vehicles", "vehicle_candidates", "order_candidates"])
def test_no_list_of_keys_is_empty(keys: str) -> None:
    with pytest.raises(ValidationError, match=keys):
        DispatchSettings.model_validate({keys: []})


def test_no_vehicle_parks_or_recharges_unless_enabled() -> None:
    settings = DispatchSettings()
    assert not settings.parking.enabled
    assert not settings.recharging.enabled
