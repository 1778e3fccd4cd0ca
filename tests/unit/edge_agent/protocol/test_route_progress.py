"""The distance that the robot has driven, and has left."""

from __future__ import annotations

from datetime import timedelta

import pytest

from nena_edge_agent.driver.port import DriveProgress, PlanReport
from nena_edge_agent.protocol.events import Started
from nena_shared.vda5050.state import State
from support.robot_core import HEADER, Bench, at, order


def drive(bench: Bench, start: float, end: float) -> None:
    """Report poses every quarter of a metre."""
    steps = round((end - start) * 4)
    bench.do(*(at(start + step * 0.25) for step in range(1, steps + 1)))


def references(state: State) -> dict[str, str]:
    found = next((each for each in state.information or () if each.info_type == "progress"), None)
    return {each.reference_key: each.reference_value for each in found.info_references} if found else {}


@pytest.mark.clause("6.6.2", "7.8/distance")
def test_distance_since_the_last_node_grows_and_restarts_at_the_next(bench: Bench) -> None:
    drive(bench, 0.0, 6.0)
    assert bench.state.distance_since_last_node == pytest.approx(6.0)
    drive(bench, 6.0, 10.0)
    bench.arrive()
    assert bench.state.distance_since_last_node == 0.0
    drive(bench, 10.0, 12.5)
    assert bench.state.distance_since_last_node == pytest.approx(2.5)


def test_a_robot_without_a_node_has_no_distance_to_it() -> None:
    assert Bench().state.distance_since_last_node is None


def test_a_detour_counts_but_poses_at_standstill_do_not(bench: Bench) -> None:
    bench.do(*(at(0.0, y * 0.25) for y in range(9)), *(at(0.0, 2.0 - y * 0.25) for y in range(9)))
    assert bench.state.distance_since_last_node == pytest.approx(4.0)
    bench.do(*(at(0.01 * (-1) ** number) for number in range(100)))
    assert bench.state.distance_since_last_node == pytest.approx(4.0)


def test_a_jump_of_the_localisation_is_not_counted_as_distance(bench: Bench) -> None:
    bench.do(at(8.0))
    assert bench.state.distance_since_last_node == 0.0
    drive(bench, 8.0, 9.0)
    assert bench.state.distance_since_last_node == pytest.approx(1.0)


def test_the_remaining_distance_follows_the_nodes_without_a_plan(bench: Bench) -> None:
    drive(bench, 0.0, 5.0)
    assert references(bench.state) == {
        "goalDistanceLeft": "5.00",
        "goalPercent": "50",
        "orderDistanceLeft": "15.00",
        "orderPercent": "25",
    }
    drive(bench, 5.0, 10.0)
    bench.arrive()
    drive(bench, 10.0, 12.5)
    assert references(bench.state)["goalPercent"] == "25"


def test_the_remaining_distance_follows_a_plan_to_the_goal(bench: Bench) -> None:
    bench.do(PlanReport(((0.0, 0.0), (0.0, 5.0), (10.0, 5.0), (10.0, 0.3))))
    bench.do(at(0.0, 5.0))
    assert references(bench.state)["goalDistanceLeft"] == "14.70"
    assert references(bench.state)["orderDistanceLeft"] == "24.70"
    bench.do(PlanReport(((0.0, 0.0), (7.0, 7.0))))
    assert references(bench.state)["goalDistanceLeft"] == f"{(10**2 + 5**2) ** 0.5:.2f}"


def test_at_the_end_the_remaining_distance_is_0(bench: Bench) -> None:
    bench.arrive()
    bench.arrive()
    assert references(bench.state) == {}
    assert bench.state.distance_since_last_node == 0.0


@pytest.mark.clause("6.6.2/path")
def test_the_plan_is_reported_with_arrival_times(bench: Bench) -> None:
    bench.do(PlanReport(((0.0, 0.0), (0.0, 4.0), (10.0, 0.0))))
    for path in (bench.state.intermediate_path, bench.core.visualization(HEADER, 3).intermediate_path):
        assert path is not None
        assert [(point.x, point.y) for point in path.polyline] == [(0.0, 0.0), (0.0, 4.0), (10.0, 0.0)]
        times = [point.eta - HEADER["timestamp"] for point in path.polyline]
        assert times[:2] == [timedelta(0), timedelta(seconds=4)]
    assert bench.core.visualization(HEADER, 3).reference_state_header_id == 3
    bench.arrive()
    assert bench.state.intermediate_path is None


def test_a_new_order_restarts_the_distance(bench: Bench) -> None:
    for _ in range(2):
        bench.arrive()
    bench.send(order("n2", "n3", order_id="o2"))
    assert references(bench.state)["orderPercent"] == "0"


def test_after_a_restart_the_distance_starts_at_the_last_node(bench: Bench) -> None:
    drive(bench, 0.0, 6.0)
    again = Bench(memory=bench.core.memory(), ready=False)
    again.do(at(6.0), Started())
    assert again.state.distance_since_last_node == pytest.approx(6.0)


def test_without_a_plan_the_remaining_distance_is_that_of_navigation(bench: Bench) -> None:
    drive(bench, 0.0, 5.0)
    bench.do(DriveProgress(7.5, 2, "map"))
    assert references(bench.state)["goalDistanceLeft"] == "7.50"
    assert references(bench.state)["recoveries"] == "2"
    drive(bench, 5.0, 10.0)
    bench.arrive()
    assert references(bench.state)["goalDistanceLeft"] == "10.00"
    assert "recoveries" not in references(bench.state)
