from __future__ import annotations

import pytest
import typer

from nena_cli.fleet.measures import parse_measure
from nena_shared.fleet_api.failure_policy import FailureMeasure, FailureStep


@pytest.mark.parametrize(
    ("text", "step"),
    [
        ("HOLD", FailureStep(do=FailureMeasure.HOLD)),
        ("retry:2", FailureStep(do=FailureMeasure.RETRY, times=2)),
        ("RETRY:2:0.5", FailureStep(do=FailureMeasure.RETRY, times=2, after=0.5)),
    ],
)
def test_a_measure_is_read(text: str, step: FailureStep) -> None:
    assert parse_measure(text) == step


@pytest.mark.parametrize("text", ["", "PRAY", "RETRY:often", "HOLD:2", "RETRY:1:2:3"])
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(typer.BadParameter, match="is no measure"):
        parse_measure(text)
