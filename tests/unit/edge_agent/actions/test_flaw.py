"""Reports that are sound; those that are not are in test_run."""

from __future__ import annotations

import pytest

from nena_edge_agent.actions.flaw import flaw_of
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.state import Load


@pytest.mark.parametrize(
    "report",
    [
        ActionReport("a", ActionStatus.INITIALIZING),
        ActionReport("a", ActionStatus.RUNNING, "at 40 %"),
        ActionReport("a", ActionStatus.FINISHED, "done", loads=(), charging=False),
        ActionReport("a", ActionStatus.FINISHED, loads=(Load(load_id="box"),)),
    ],
)
def test_a_sound_report_has_no_flaw(report: ActionReport) -> None:
    assert flaw_of(report, "a") is None


def test_a_flaw_is_named_in_short() -> None:
    assert len(flaw_of("x" * 10_000, "a") or "") < 200
