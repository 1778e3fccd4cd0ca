from __future__ import annotations

from typing import Any

import pytest

from nena_order_service.dispatching.dispatcher import Carried, Pick, carried
from nena_shared.vda5050.factsheet import Factsheet, LoadSpecification
from support.fleet_examples import factsheet, state

ONE = "carries a load, and has no room for another one"


def specified(**specification: Any) -> Factsheet:
    told = LoadSpecification.model_validate(specification, strict=False)
    return factsheet().model_copy(update={"load_specification": told})


def at(*places: str | None) -> tuple[dict[str, Any], ...]:
    return tuple({"load_id": str(index), "load_position": place} for index, place in enumerate(places))


def why(places: tuple[str | None, ...], sheet: Factsheet | None, pick: Pick) -> str:
    found = carried(state(loads=at(*places)), sheet)
    assert found
    return found.why_no_room(pick)


@pytest.mark.clause("7.8/loads")
@pytest.mark.parametrize("loads", [None, ()], ids=["cannot tell", "empty"])
def test_who_carries_nothing_or_cannot_tell_has_room(loads: tuple[()] | None) -> None:
    assert carried(state(loads=loads), None) is None


@pytest.mark.parametrize("sheet", [None, specified(), specified(load_positions=())])
def test_who_says_of_no_places_has_one(sheet: Factsheet | None) -> None:
    assert why((None,), sheet, Pick()) == ONE
    assert why(("front",), sheet, Pick("pallet")) == ONE
    assert why(("front",), sheet, Pick(place="front")) == f"{ONE} at 'front'"
    assert why(("front",), sheet, Pick(place="rear")) == ""


def test_each_place_takes_one_load() -> None:
    sheet = specified(load_positions=("front", "rear"))
    assert why((None,), sheet, Pick()) == ""
    assert why(("front", "rear"), sheet, Pick()) == "carries 2 loads, and has no room for another one"
    assert why(("front", None), sheet, Pick()).startswith("carries 2 loads")
    assert why(("front",), sheet, Pick(place="rear")) == ""
    assert why((None,), sheet, Pick(place="rear")) == f"{ONE} at 'rear'"


def test_loads_of_some_types_go_to_some_places_only() -> None:
    sets = (
        {"set_name": "a", "load_type": "pallet", "load_positions": ("fork",)},
        {"set_name": "b", "load_type": "box", "load_positions": ("fork",)},
        {"set_name": "c", "load_type": "box", "load_positions": ("shelf",)},
        {"set_name": "d", "load_type": "bag"},
    )
    sheet = specified(load_positions=("fork", "shelf"), load_sets=sets)
    assert why(("fork",), sheet, Pick("pallet")) == ONE
    assert why(("shelf",), sheet, Pick("pallet")) == ""
    assert [why(("fork",), sheet, Pick(each)) for each in ("box", "bag", "crate")] == ["", "", ""]
    assert why(("elsewhere",), sheet, Pick("pallet")) == ONE


def test_what_is_carried_can_be_compared() -> None:
    sheet = specified(load_positions=("front",))
    assert carried(state(loads=at("front")), sheet) == Carried(("front",), frozenset({"front"}), {})
