from __future__ import annotations

import pytest

from nena_shared.plant.operation_names import ACTION_TYPES, action_of, operation_of


@pytest.mark.parametrize(
    ("operation", "action"),
    [("Load cargo", "pick"), ("Unload", "drop"), ("Charge", "startCharging"), ("beep", "beep")],
)
def test_what_has_a_name_in_the_standard_gets_it(operation: str, action: str) -> None:
    assert action_of(operation) == action


def test_only_charging_is_known_by_a_name_of_its_own() -> None:
    assert operation_of("startCharging") == "Charge"
    others = set(ACTION_TYPES.values()) - {"startCharging"}
    assert {operation_of(each) for each in others} == others
