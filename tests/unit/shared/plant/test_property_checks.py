import pytest

from nena_shared.plant import Location, LocationType, PlantModel, Vehicle
from nena_shared.plant.property_checks import find_property_warnings
from nena_shared.plant.vehicle_type import VehicleTypeAtPoint
from support.plants import path, plant, point

CHARGER = LocationType(name="Charger", allowed_operations=("Charge",))


def with_property(key: str, value: str) -> PlantModel:
    return plant(
        points="A",
        vehicles=(Vehicle(name="V", properties={key: value}),),
        location_types=(CHARGER,),
        locations=(Location(name="Dock", type="Charger"),),
    )


@pytest.mark.parametrize(
    ("key", "value", "code"),
    [
        ("vda5050:maxStepsBase ", "3", "MISSPELT_PROPERTY"),
        ("vda5050:serialnumber", "r1", "MISSPELT_PROPERTY"),
        ("VDA5050:mapId", "hall", "MISSPELT_PROPERTY"),
        ("tcs:preferedParkingPosition", "A", "MISSPELT_PROPERTY"),
        ("vda5050:mapId", " ", "EMPTY_PROPERTY"),
        ("vda5050:deviationXY", "half a metre", "PROPERTY_NOT_A_NUMBER"),
        ("vda5050:deviationXY", "-1", "PROPERTY_NOT_A_NUMBER"),
        ("tcs:routingCostForwardWIDE", "nan", "PROPERTY_NOT_A_NUMBER"),
        ("tcs:assignedParkingPosition", "B", "PROPERTY_NAMES_NOTHING"),
        ("tcs:preferredRechargeLocation", "A", "PROPERTY_NAMES_NOTHING"),
    ],
)
def test_suspicious_properties(key: str, value: str, code: str) -> None:
    found = list(find_property_warnings(with_property(key, value)))
    assert [(problem.code, problem.name) for problem in found] == [(code, "V")]
    assert repr(key) in found[0].text


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("vda5050:deviationXY", "0.5"),
        ("tcs:routingCostReverse", "Infinity"),
        ("tcs:assignedParkingPosition", "A"),
        ("tcs:preferredRechargeLocation", "Dock"),
        ("vda5050:maxStepsBase", "3"),
        ("tcs:preferredAdapterClass", "org.example.Factory"),
        ("loopback:acceleration", "500"),
        ("serialnumber", "r1"),
    ],
)
def test_properties_in_order_and_those_of_others(key: str, value: str) -> None:
    assert list(find_property_warnings(with_property(key, value))) == []


def test_properties_of_all_kinds_of_object_are_looked_at() -> None:
    model = PlantModel(
        name="m",
        points=(point("A", properties={"a": ""}),),
        paths=(path("A A", name="P", properties={"a": ""}),),
        properties={"a": ""},
    )
    assert [problem.name for problem in find_property_warnings(model)] == ["m", "A", "P"]


def test_a_charging_place_is_missed_where_there_are_vehicles() -> None:
    loading = LocationType(name="T", allowed_operations=("CHARGE",))
    model = plant(vehicles=(Vehicle(name="V"),), location_types=(loading,))
    (found,) = find_property_warnings(model)
    assert found.code == "NO_RECHARGE_OPERATION"
    assert "'CHARGE' is another operation" in found.text
    assert list(find_property_warnings(plant(location_types=(loading,)))) == []


@pytest.mark.parametrize(
    ("known", "own", "found"),
    [((), "t", []), (("t",), "t", []), (("u",), "t", ["PROPERTY_NAMES_NOTHING"])],
)
def test_a_vehicle_type_is_one_that_the_plant_knows_where_it_knows_any(
    known: tuple[str, ...], own: str, found: list[str]
) -> None:
    uses = tuple(VehicleTypeAtPoint(vehicle_type_id=each) for each in known)
    vehicle = Vehicle(name="V", properties={"nena:vehicleType": own})
    model = PlantModel(
        name="m",
        points=(point("A", vehicle_types=uses),),
        vehicles=(vehicle,),
        location_types=(CHARGER,),
    )
    assert [problem.code for problem in find_property_warnings(model)] == found
