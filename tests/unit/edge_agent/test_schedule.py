from __future__ import annotations

from math import inf

import pytest

from nena_edge_agent.schedule import StateSchedule, VisualizationSchedule


def test_the_first_state_is_due_at_once() -> None:
    assert StateSchedule(minimum=0.5, maximum=30.0).due == -inf


@pytest.mark.clause("6.6.1/interval")
def test_without_a_reason_the_next_state_comes_after_the_longest_interval() -> None:
    schedule = StateSchedule(minimum=0.5, maximum=30.0)
    schedule.sent(100.0)

    assert schedule.due == 130.0


@pytest.mark.clause("6.6.1/interval")
def test_a_state_is_due_when_it_is_wanted_unless_that_is_too_soon() -> None:
    schedule = StateSchedule(minimum=0.5, maximum=30.0)
    schedule.sent(100.0)

    schedule.request(100.1)
    schedule.request(100.2)
    assert schedule.due == 100.5
    schedule.sent(100.5)
    assert schedule.due == 130.5

    schedule.request(110.0)
    schedule.request(111.0)
    assert schedule.due == 110.0


@pytest.mark.clause("6.7")
def test_visualization_keeps_its_rate_and_does_not_make_up_for_what_was_missed() -> None:
    schedule = VisualizationSchedule(interval=2.0, now=100.0)
    assert schedule.due == 100.0

    schedule.sent(100.3)
    assert schedule.due == 102.0
    schedule.sent(109.0)
    assert schedule.due == 109.0


@pytest.mark.clause("6.7")
def test_an_interval_of_0_means_never() -> None:
    assert VisualizationSchedule(interval=0.0, now=100.0).due == inf
