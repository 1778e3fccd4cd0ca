from __future__ import annotations

import pytest

from nena_edge_agent.actions.nav2_operations import declaration_of
from nena_edge_agent.actions.settings import Behaviour, Nav2OperationSettings
from nena_shared.vda5050.action import Action, ActionParameter, BlockingType
from nena_shared.vda5050.factsheet import ActionScope


@pytest.mark.parametrize(
    ("behavior", "distance", "taken"),
    [
        (Behaviour.DRIVE_ON_HEADING, 0.0, False),
        (Behaviour.DRIVE_ON_HEADING, -0.5, False),
        (Behaviour.DRIVE_ON_HEADING, 0.1, True),
        (Behaviour.BACK_UP, 0.0, True),
    ],
)
def test_a_distance_that_nav2_refuses_is_refused_with_the_order(
    behavior: Behaviour, distance: float, *, taken: bool
) -> None:
    settings = Nav2OperationSettings.model_validate(
        {"kind": "nav2", "action_type": "move", "behavior": behavior}
    )
    move = Action(
        action_type="move",
        action_id="a",
        blocking_type=BlockingType.HARD,
        action_parameters=(ActionParameter(key="distance", value=distance),),
    )

    problem = declaration_of(settings).problem(move, ActionScope.NODE)

    assert (problem is None) is taken, problem
