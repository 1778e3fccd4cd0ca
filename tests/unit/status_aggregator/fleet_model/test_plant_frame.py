"""Robots are shown in the plant's frame, whoever transforms."""

from __future__ import annotations

from typing import Any

import pytest

from nena_shared.plant import PlantModel
from nena_shared.vda5050.brief.state import PositionBrief
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.own_actions import SHOW_MAP_TRANSFORMS
from nena_status_aggregator.fleet_model.instant import Instant
from nena_status_aggregator.fleet_model.model import FleetModel, ModelLimits
from nena_status_aggregator.fleet_model.plant_frame import PlantFrame
from support.fleet_briefs import place, state
from support.fleet_examples import ROBOT, START, factsheet, position

PLANT = PlantModel(name="p", properties={"nena:mapTransform.hall": "scale=2 rotation=90 x=20"})
TURNED = PlantFrame.of(PLANT)
"""(x, y) of the plant is (20 - 2y, 2x) on the map."""


def sheet(*action_types: str) -> Factsheet:
    content = factsheet().model_dump(by_alias=True)
    actions: list[dict[str, Any]] = [
        {"actionType": each, "actionScopes": ("INSTANT",), "pauseAllowed": False, "cancelAllowed": False}
        for each in action_types
    ]
    features = {"optionalParameters": (), "mobileRobotActions": actions}
    return Factsheet.model_validate({**content, "protocolFeatures": features}, strict=False)


def xy(position: PositionBrief | None) -> tuple[float, float] | None:
    return (position.x, position.y) if position else None


@pytest.mark.parametrize(
    ("told", "shown"),
    [(sheet("pick"), (0.0, 5.0)), (sheet(SHOW_MAP_TRANSFORMS), (10.0, 0.0)), (None, None)],
    ids=["of its map", "of the plant", "nobody knows yet"],
)
def test_by_the_frame_in_which_the_robot_speaks(
    told: Factsheet | None, shown: tuple[float, float] | None
) -> None:
    position = TURNED.position(place(10.0, 0.0), told)
    assert xy(position) == (shown and pytest.approx(shown))
    assert TURNED.place(10.0, 0.0, "hall", told) == (shown and pytest.approx(shown))


def test_on_a_map_without_a_transform_all_is_as_it_was() -> None:
    assert TURNED.position(place(10.0, 0.0, map_id="roof"), None) == place(10.0, 0.0, map_id="roof")
    assert TURNED.place(10.0, 0.0, None, None) == (10.0, 0.0)
    assert TURNED.position(None, None) is None
    assert PlantFrame.of(None).place(1.0, 2.0, "hall", None) == (1.0, 2.0)


def test_a_plant_that_says_nonsense_says_nothing() -> None:
    nonsense = PlantModel(name="p", properties={"nena:mapTransform.hall": "twice as big"})
    assert PlantFrame.of(nonsense) == PlantFrame()


def test_a_plant_that_comes_later_puts_robots_where_they_are() -> None:
    fleet = FleetModel(ModelLimits())
    instant = Instant(0.0, START)
    fleet.on_factsheet(ROBOT, sheet("pick"), instant)
    fleet.on_state(ROBOT, state(mobile_robot_position=position(10.0, 0.0)), instant)

    def shown() -> tuple[float, float] | None:
        fleet.flush(instant)
        view = fleet.robot_view(ROBOT)
        assert view is not None
        return view["position"] and (view["position"]["x"], view["position"]["y"])

    assert shown() == (10.0, 0.0)
    fleet.on_plant_model(PLANT)
    assert shown() == (0.0, 5.0)
