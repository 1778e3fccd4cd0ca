from __future__ import annotations

from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.own_actions import SHOW_MAP_TRANSFORMS, transforms_itself
from support.fleet_examples import factsheet


def listing(*action_types: str) -> Factsheet:
    content = factsheet().model_dump(by_alias=True)
    actions = [
        {"actionType": each, "actionScopes": ("INSTANT",), "pauseAllowed": False, "cancelAllowed": False}
        for each in action_types
    ]
    features = {"optionalParameters": (), "mobileRobotActions": actions}
    return Factsheet.model_validate({**content, "protocolFeatures": features}, strict=False)


def test_a_robot_that_shows_its_transforms_does_them_itself() -> None:
    assert transforms_itself(listing("pick", SHOW_MAP_TRANSFORMS))
    assert not transforms_itself(listing("pick"))
    assert not transforms_itself(listing())
