"""Robots are shown in the plant's frame, whichever side transforms."""

from __future__ import annotations

from datetime import timedelta
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nena_shared.clock import iso
from nena_shared.plant import PlantModel
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.own_actions import SHOW_MAP_TRANSFORMS
from nena_shared.vda5050.state import MobileRobotPosition
from nena_status_aggregator.fleet.condition import Condition
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.fleet.robot import Odometer, OrderProgress, PlantFrame, Robot, Timestamp
from support.fleet_examples import ROBOT, START, connection, factsheet, position, way
from support.fleet_records import place, state, visualization


def at(seconds: float) -> Timestamp:
    return Timestamp(1000 + seconds, START + timedelta(seconds=seconds))


def condition_of(robot: Robot, seconds: float) -> Condition:
    robot.update_condition(at(seconds), None, link_up=True)
    return robot.condition


def test_silence_limit_is_35_s_unless_the_factsheet_has_a_longer_interval() -> None:
    robot = Robot(ROBOT, at(0))
    assert robot.silence_limit(None) == 35
    robot.factsheet = factsheet(state_interval=5.0)
    assert robot.silence_limit(None) == 35
    robot.factsheet = factsheet(state_interval=30.0)
    assert robot.silence_limit(None) == 90
    robot.factsheet = factsheet(state_interval=30_000.0)
    assert robot.silence_limit(None) == 90, "milliseconds"
    assert robot.silence_limit(4.0) == 4


def test_silent_after_the_limit_and_back_with_the_next_state() -> None:
    robot = Robot(ROBOT, at(0))
    robot.on_state(state(), at(0), retained=False)
    assert condition_of(robot, 35) is Condition.IDLE
    assert condition_of(robot, 35.1) is Condition.SILENT
    assert robot.condition_since == at(35.1).utc
    robot.on_state(state(2), at(40), retained=False)
    assert condition_of(robot, 41) is Condition.IDLE


def test_falling_silent_is_reported_once_per_silence() -> None:
    robot = Robot(ROBOT, at(0))
    robot.on_state(state(), at(0), retained=False)
    silent = [robot.notice_silence(at(seconds), None) for seconds in (10, 36, 37)]
    robot.on_state(state(2), at(40), retained=False)
    silent += [robot.notice_silence(at(seconds), None) for seconds in (41, 80)]
    assert silent == [False, True, False, False, True]


def test_age_of_a_retained_state_is_from_its_timestamp() -> None:
    robot = Robot(ROBOT, at(0))
    robot.on_state(state(at=-100), at(0), retained=True)
    assert robot.state_age(at(5)) == pytest.approx(105)
    assert robot.skew.seconds is None
    assert condition_of(robot, 5) is Condition.SILENT


def test_last_will_breaks_the_connection_until_the_next_state() -> None:
    robot = Robot(ROBOT, at(0))
    robot.on_connection(connection("ONLINE"), at(0))
    robot.on_state(state(), at(1), retained=False)
    robot.on_connection(connection("CONNECTION_BROKEN"), at(2))
    assert condition_of(robot, 2) is Condition.BROKEN
    assert robot.connection_since == at(2).utc
    robot.on_connection(connection("ONLINE", 2), at(9))
    assert condition_of(robot, 9) is Condition.IDLE


def test_repeated_retained_connection_changes_nothing() -> None:
    robot = Robot(ROBOT, at(0))
    robot.on_connection(connection("ONLINE"), at(0))
    robot.on_connection(connection("ONLINE"), at(50))
    assert robot.connection_since == at(0).utc


def test_visualization_updates_the_position_only() -> None:
    robot = Robot(ROBOT, at(0))
    robot.on_state(state(), at(0), retained=False)
    robot.on_visualization(visualization(x=4.0))
    assert robot.position is not None
    assert robot.position.x == 4.0
    assert robot.state_age(at(10)) == 10


def test_times_are_written_with_milliseconds() -> None:
    assert iso(START) == "2026-01-01T00:00:00.000Z"
    assert iso(START + timedelta(microseconds=123_999)) == "2026-01-01T00:00:00.123Z"


def driven(*positions: MobileRobotPosition | None) -> float:
    odometer = Odometer()
    for each in positions:
        odometer.add_position(each)
    return odometer.meters


def test_distances_add_up() -> None:
    assert driven(place(0, 0), place(3, 4), place(3, 6)) == 7


def test_a_standing_robot_with_noise_does_not_drive_and_a_slow_one_does() -> None:
    assert driven(*(place(0.004 * (number % 2), 0) for number in range(100))) == 0
    assert driven(*(place(0.004 * number, 0) for number in range(101))) == pytest.approx(0.4, abs=0.02)


@pytest.mark.parametrize(
    "jump", [place(100, 0), place(3, 0, map_id="yard"), place(3, 0, localized=False), None], ids=repr
)
def test_jumps_do_not_count_as_driving(jump: MobileRobotPosition | None) -> None:
    assert driven(place(0, 0), place(1, 0), jump) == 1
    assert driven(place(0, 0), jump, place(1, 0), place(2, 0)) in (1, 2)


def follow(progress: OrderProgress, **fields: Any) -> float:
    progress.update_from(state(**fields))
    return progress.percent


def test_nodes_left_against_nodes_at_acceptance() -> None:
    progress = OrderProgress()
    assert follow(progress, order_id="o", **way("B", "C", "D", "E")) == 0
    assert follow(progress, order_id="o", last_node_sequence_id=2, **way("C", "D", "E", first=4)) == 25
    assert follow(progress, order_id="o", last_node_sequence_id=8) == 100


def test_progress_is_complete_when_started_during_an_order() -> None:
    assert follow(OrderProgress(), order_id="o", last_node_sequence_id=6, **way("E", first=8)) == 75


def test_an_extended_base_makes_the_order_longer() -> None:
    progress = OrderProgress()
    assert follow(progress, order_id="o", last_node_sequence_id=2, **way("C", first=4)) == 50
    assert follow(progress, order_id="o", last_node_sequence_id=2, **way("C", "D", "E", first=4)) == 25


def test_progress_of_a_cancelled_order_is_kept() -> None:
    progress = OrderProgress()
    follow(progress, order_id="o", last_node_sequence_id=2, **way("C", "D", "E", first=4))
    assert follow(progress, order_id="o", last_node_sequence_id=2) == 25


def test_progress_restarts_with_the_next_order() -> None:
    progress = OrderProgress()
    follow(progress, order_id="o", last_node_sequence_id=8)
    assert follow(progress, order_id="p", **way("B", "C")) == 0


def test_an_order_of_one_node_has_nothing_to_drive() -> None:
    assert follow(OrderProgress(), order_id="o") == 100


def test_a_robot_that_lists_its_first_node_too_is_not_below_zero() -> None:
    assert follow(OrderProgress(), order_id="o", **way("A", "B", first=0)) == 0


@settings(deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 9), st.integers(0, 6), st.integers(0, 40), st.sampled_from("op"))),
)
def test_always_between_0_and_100(states: list[tuple[int, int, int, str]]) -> None:
    progress = OrderProgress()
    for first, count, last, order_id in states:
        nodes = way(*[f"n{each}" for each in range(count)], first=2 * first)
        if first:
            percent = follow(progress, order_id=order_id, last_node_sequence_id=last, **nodes)
            assert 0 <= percent <= 100


PLANT = PlantModel(name="p", properties={"nena:mapTransform.hall": "scale=2 rotation=90 x=20"})
TURNED = PlantFrame.from_plant(PLANT)
"""(x, y) of the plant is (20 - 2y, 2x) on the map."""


def sheet(*action_types: str) -> Factsheet:
    content = factsheet().model_dump(by_alias=True)
    actions: list[dict[str, Any]] = [
        {"actionType": each, "actionScopes": ("INSTANT",), "pauseAllowed": False, "cancelAllowed": False}
        for each in action_types
    ]
    features = {"optionalParameters": (), "mobileRobotActions": actions}
    return Factsheet.model_validate({**content, "protocolFeatures": features}, strict=False)


def xy(position: MobileRobotPosition | None) -> tuple[float, float] | None:
    return (position.x, position.y) if position else None


@pytest.mark.parametrize(
    ("sheet", "shown"),
    [(sheet("pick"), (0.0, 5.0)), (sheet(SHOW_MAP_TRANSFORMS), (10.0, 0.0)), (None, None)],
    ids=["of its map", "of the plant", "nobody knows yet"],
)
def test_position_is_converted_from_the_robots_frame(
    sheet: Factsheet | None, shown: tuple[float, float] | None
) -> None:
    position = TURNED.to_plant_position(place(10.0, 0.0), sheet)
    assert xy(position) == (shown and pytest.approx(shown))
    assert TURNED.to_plant_point(10.0, 0.0, "hall", sheet) == (shown and pytest.approx(shown))


def test_map_without_a_transform_is_in_the_plant_frame() -> None:
    assert TURNED.to_plant_position(place(10.0, 0.0, map_id="roof"), None) == place(10.0, 0.0, map_id="roof")
    assert TURNED.to_plant_point(10.0, 0.0, None, None) == (10.0, 0.0)
    assert TURNED.to_plant_position(None, None) is None
    assert PlantFrame.from_plant(None).to_plant_point(1.0, 2.0, "hall", None) == (1.0, 2.0)


def test_invalid_transforms_are_ignored() -> None:
    nonsense = PlantModel(name="p", properties={"nena:mapTransform.hall": "twice as big"})
    assert PlantFrame.from_plant(nonsense) == PlantFrame()


def test_positions_are_transformed_by_a_later_plant_model() -> None:
    fleet = FleetModel(ModelLimits())
    instant = Timestamp(0.0, START)
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
