from __future__ import annotations

from nena_status_aggregator.history.replay import POSITIONS_LIMIT, Track, step_of

HOUR = 3_600_000


def test_positions_are_differences_and_the_one_before_the_range_is_where_it_begins() -> None:
    track = Track("A/1", since=10_000)
    track.add_position(4_000, {"x": 1.0, "y": 2.0, "theta": 1.57})
    track.add_position(11_500, {"x": 1.5, "y": 2.0, "theta": 1.57})
    track.add_position(12_000, {"x": 1.5, "y": 1.9, "theta": -1.57})
    assert track.replay["times"] == [0, 15, 5]
    assert (track.replay["x"], track.replay["y"]) == ([100, 50, 0], [200, 0, -10])
    assert track.replay["theta"] == [157, 157, -157]


def test_looks_tell_what_waits_is_urgent_and_carries_loads() -> None:
    track = Track("A/1", since=0)
    track.add_change(
        1_000, "condition", {"condition": "WAITING", "reason": "waits_passing", "before": "BUSY"}
    )
    track.add_change(
        2_000, "condition", {"condition": "WAITING", "reason": "waits_turn", "before": "WAITING"}
    )  # looks the same
    track.add_change(
        3_000, "condition", {"condition": "BLOCKED", "reason": "emergency_stop", "before": "WAITING"}
    )
    track.add_change(4_000, "condition", {"condition": "BLOCKED", "reason": "paused", "before": "BLOCKED"})
    track.add_change(5_000, "loads", {"loads": 2})
    track.add_change(5_500, "jam", {"robots": 11})
    track.add_change(5_700, "jam", {"robots": 0})
    track.add_change(6_000, "robotForgotten", {})
    assert track.replay["looks"] == [
        (0, "BUSY", False, 0, 0),
        (10, "WAITING", False, 0, 0),
        (30, "BLOCKED", True, 0, 0),
        (40, "BLOCKED", False, 0, 0),
        (50, "BLOCKED", False, 2, 0),
        (55, "BLOCKED", False, 2, 11),
        (57, "BLOCKED", False, 2, 0),
        (60, None, False, 2, 0),
    ]


def test_positions_are_thinned_as_far_as_needed() -> None:
    assert step_of(HOUR, robots=50) < 1_000
    assert step_of(1, robots=1) == 1
    assert step_of(8 * HOUR, robots=50) == 6_000
    assert 1_000 * 24 * HOUR / step_of(24 * HOUR, robots=1_000) <= POSITIONS_LIMIT
