from __future__ import annotations

from collections.abc import Collection
from math import inf

from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.vehicles.parking import (
    BARRED,
    PARKED,
    WAYS_TRIED,
    Parking,
    ParkingPositions,
    Prospect,
)
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.plant import PlantModel, Vehicle
from nena_shared.plant.property_keys import (
    ASSIGNED_PARKING_POSITION,
    PARKING_POSITION_PRIORITY,
    PREFERRED_PARKING_POSITION,
)
from nena_shared.plant_terms import PointType
from support.plants import point

PARK = PointType.PARK_POSITION
PLANT = PlantModel(
    name="yard",
    points=(
        point("near", type=PARK),
        point("good", type=PARK, properties={PARKING_POSITION_PRIORITY: "1"}),
        point("fair", type=PARK, properties={PARKING_POSITION_PRIORITY: "2"}),
        point("aisle"),
    ),
)
COSTS = {"near": 1.0, "fair": 2.0, "good": 3.0, "aisle": 0.0}


def choose(
    here: str | None = "aisle",
    taken: Collection[str] = (),
    *,
    displacing: Collection[str] = (),
    may_displace: bool = True,
    priorities: bool = False,
    repark: bool = False,
    plant: PlantModel = PLANT,
    requests: dict[str, str] | None = None,
) -> Parking:
    model = Vehicle(name="V1", properties=requests or {})
    positions = ParkingPositions(plant, priorities=priorities, repark=repark)
    prospect = Prospect(
        cost=lambda name: COSTS.get(name, inf),
        taken=lambda name: name in taken,
        displaces=lambda name: name in displacing,
        may_displace=may_displace,
    )
    return positions.choose(model, here, prospect)


def properties_of(key: str, value: str) -> dict[str, str]:
    return {key: value}


def test_nearest_free_position_is_taken() -> None:
    assert choose().point == "near"
    assert choose(taken=["near"]).point == "fair"
    assert choose(here=None).point == "near"


def test_respected_priorities_take_precedence_over_route_cost() -> None:
    assert choose(priorities=True).point == "good"
    assert choose(priorities=True, taken=["good", "fair"]).point == "near"


def test_a_parked_vehicle_stays_unless_a_better_position_is_free() -> None:
    assert choose(here="fair") == PARKED
    assert choose(here="fair", priorities=True) == PARKED
    assert choose(here="fair", priorities=True, repark=True).point == "good"
    assert choose(here="good", priorities=True, repark=True) == PARKED
    assert choose(here="fair", taken=["good"], priorities=True, repark=True) == PARKED


def test_assigned_position_is_the_only_one() -> None:
    assigned = properties_of(ASSIGNED_PARKING_POSITION, "fair")
    assert choose(requests=assigned).point == "fair"
    assert choose(here="near", requests=assigned).point == "fair"
    assert choose(here="fair", requests=assigned) == PARKED
    assert (
        str(choose(taken=["fair"], requests=assigned).reason)
        == "its assigned parking position 'fair' is taken"
    )
    gone = choose(requests=properties_of(ASSIGNED_PARKING_POSITION, "gone"))
    assert str(gone.reason) == "its assigned parking position 'gone' is not a point of the plant model"


def test_preferred_position_is_chosen_while_free() -> None:
    preferred = properties_of(PREFERRED_PARKING_POSITION, "good")
    assert choose(requests=preferred).point == "good"
    assert choose(taken=["good"], requests=preferred).point == "near"
    assert choose(here="near", requests=preferred) == PARKED


def test_a_position_that_displaces_others_is_the_last_choice() -> None:
    assert choose(displacing=["near"]).point == "fair"
    assert choose(displacing=["near", "fair", "good"]).point == "near"
    assert choose(displacing=["good"], priorities=True).point == "fair"
    preferred = properties_of(PREFERRED_PARKING_POSITION, "good")
    assert choose(displacing=["good"], requests=preferred).point == "good"


def test_positions_of_vehicles_that_must_not_move_are_excluded() -> None:
    assert choose(displacing=["near", "fair"], may_displace=False).point == "good"
    barred = choose(displacing=["near", "fair", "good"], may_displace=False)
    assert barred == Parking(reason=Reason(ReasonCode.PARKING_BARRED))
    assigned = properties_of(ASSIGNED_PARKING_POSITION, "fair")
    assert choose(displacing=["fair"], may_displace=False, requests=assigned) == Parking(
        reason=Reason(ReasonCode.ASSIGNED_PARKING, BARRED, point="fair")
    )
    preferred = properties_of(PREFERRED_PARKING_POSITION, "good")
    assert choose(displacing=["good"], may_displace=False, requests=preferred).point == "near"


def test_only_some_positions_are_evaluated() -> None:
    names = [f"P{index:02}" for index in range(2 * WAYS_TRIED)]
    positions = ParkingPositions(
        PlantModel(name="yard", points=tuple(point(name, type=PARK) for name in names)),
        priorities=False,
        repark=False,
    )
    asked: list[str] = []

    def displaces(name: str) -> bool:
        asked.append(name)
        return True

    prospect = Prospect(cost=lambda _: 1.0, taken=lambda _: False, displaces=displaces)
    assert positions.choose(None, None, prospect).point == names[0]
    assert asked == names[:WAYS_TRIED]


def test_the_reason_why_no_vehicle_can_park_is_reported() -> None:
    full = choose(taken=["near", "fair", "good"])
    assert full == Parking(reason=Reason(ReasonCode.NO_PARKING_FREE))
    nowhere = choose(plant=PlantModel(name="no yard", points=(point("aisle"),)))
    assert str(nowhere.reason) == "the plant model has no parking positions"


@given(
    taken=st.sets(st.sampled_from(sorted(COSTS))),
    here=st.none() | st.sampled_from(sorted(COSTS)),
    requests=st.dictionaries(
        st.sampled_from([ASSIGNED_PARKING_POSITION, PREFERRED_PARKING_POSITION]),
        st.sampled_from([*COSTS, "gone"]),
    ),
    modes=st.tuples(st.booleans(), st.booleans()),
)
def test_no_vehicle_is_sent_to_a_taken_point_or_its_own(
    taken: set[str], here: str | None, requests: dict[str, str], modes: tuple[bool, bool]
) -> None:
    found = choose(here, taken - {here or ""}, priorities=modes[0], repark=modes[1], requests=requests)
    assert not (found.point and found.reason)
    if found.point:
        assert found.point not in taken
        assert found.point != here
        assert COSTS[found.point] < inf
    elif not found.reason:
        assert here in ("near", "good", "fair", *requests.values())
