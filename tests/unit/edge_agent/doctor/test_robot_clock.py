from __future__ import annotations

import pytest

from nena_edge_agent.doctor.finding import Verdict
from nena_edge_agent.doctor.robot_clock import judge_clock, kernel_keeps_time


@pytest.mark.parametrize(
    ("kept", "offset", "verdict"),
    [
        (True, 0.01, Verdict.OK),
        (True, None, Verdict.OK),
        (None, -1.9, Verdict.OK),
        (False, 0.0, Verdict.DOUBTFUL),
        (False, None, Verdict.DOUBTFUL),
        (True, 2.1, Verdict.MISSING),
        (False, -1_795_000_000.0, Verdict.MISSING),
    ],
)
def test_stamps_that_are_off_weigh_more_than_what_the_kernel_knows(
    *, kept: bool | None, offset: float | None, verdict: Verdict
) -> None:
    assert judge_clock(kept=kept, ros_offset=offset).verdict is verdict


def test_simulated_time_is_thought_of() -> None:
    assert "use_sim_time" in judge_clock(kept=True, ros_offset=-1_795_000_000.0).remedy


def test_the_kernel_answers() -> None:
    assert kernel_keeps_time() in (True, False)
