from __future__ import annotations

import pytest

from nena_order_service.dispatching.dispatcher import acceptable, type_priority, why_not_accepted
from nena_shared.fleet_api.order_types import ANY_ORDER_TYPE


def test_of_a_vehicle_of_which_nobody_has_said_anything_any_type_is_accepted() -> None:
    assert acceptable(None) == ANY_ORDER_TYPE
    assert why_not_accepted(acceptable(None), "-") == ""


@pytest.mark.parametrize(
    ("names", "order_type", "priority"),
    [
        (("Transport", "Charge"), "Transport", 0),
        (("Transport", "Charge"), "Charge", 1),
        (("Transport", "Charge"), "-", None),
        (("*", "Charge"), "Charge", 1),
        (("Charge", "*"), "Transport", 1),
        ((), "Transport", None),
    ],
)
def test_the_very_type_counts_more_than_any(
    names: tuple[str, ...], order_type: str, priority: int | None
) -> None:
    assert type_priority(acceptable(names), order_type) == priority


def test_the_reason_names_what_is_accepted() -> None:
    assert why_not_accepted(acceptable(("B", "A")), "-") == "accepts no orders of type '-', only 'B', 'A'"
    assert why_not_accepted((), "-") == "accepts no orders of any type"
