from math import pi

import pytest
from pydantic import ValidationError

from nena_shared.plant import EnergyThresholds, Vehicle


def test_properties_say_how_the_robot_is_reached() -> None:
    vehicle = Vehicle(
        name="V",
        max_velocity_mm_s=1200,
        properties={
            "vda5050:interfaceName": "uagv",
            "vda5050:manufacturer": "ACME",
            "vda5050:serialNumber": "r1",
            "vda5050:version": "2.1.0",
            "vda5050:mapId": "hall",
            "vda5050:deviationXY": "0.25",
            "vda5050:deviationTheta": "180",
            "tcs:routingGroup": "wide",
        },
    )
    assert (vehicle.interface_name, vehicle.manufacturer, vehicle.serial_number) == ("uagv", "ACME", "r1")
    assert (vehicle.protocol_version, vehicle.map_id, vehicle.routing_group) == ("2.1.0", "hall", "wide")
    assert vehicle.deviation_xy_m == 0.25
    assert vehicle.deviation_theta_rad == pytest.approx(pi)
    assert vehicle.max_velocity_m_s == 1.2


def test_a_vehicle_without_properties_says_nothing() -> None:
    vehicle = Vehicle(name="V")
    assert vehicle.manufacturer is vehicle.serial_number is vehicle.interface_name is None
    assert vehicle.protocol_version is vehicle.map_id is None
    assert vehicle.deviation_xy_m is None
    assert vehicle.routing_group == ""


@pytest.mark.parametrize("value", ["wide", "-1", "nan", "inf", ""])
def test_a_deviation_that_is_no_number_from_0_up_is_not_set(value: str) -> None:
    assert Vehicle(name="V", properties={"vda5050:deviationXY": value}).deviation_xy_m is None


@pytest.mark.parametrize(
    "levels", [{"critical": 50, "good": 40}, {"sufficiently_recharged": 91}, {"good": 101}, {"critical": -1}]
)
def test_thresholds_are_percent_and_not_crossed(levels: dict[str, int]) -> None:
    with pytest.raises(ValidationError):
        EnergyThresholds(**levels)
