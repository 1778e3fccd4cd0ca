from __future__ import annotations

import pytest
import typer

from nena_cli.arguments import parse_coordinate, parse_measure, parse_property, parse_stop
from nena_shared.fleet_api.transport_order import (
    Coordinate,
    Destination,
    FailureMeasure,
    FailureStep,
    Property,
)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("South 2", Destination(location_name="South 2")),
        ("Goods in:Load cargo", Destination(location_name="Goods in", operation="Load cargo")),
        ("a:b:NOP", Destination(location_name="a:b", operation="NOP")),
        ("@1.5,-2", Destination(coordinate=Coordinate(x=1.5, y=-2.0))),
        ("@1,2:NOP", Destination(coordinate=Coordinate(x=1.0, y=2.0), operation="NOP")),
        ("@1,2,3.14", Destination(coordinate=Coordinate(x=1.0, y=2.0, theta=3.14))),
    ],
)
def test_stop_is_read(text: str, expected: Destination) -> None:
    assert parse_stop(text) == expected


@pytest.mark.parametrize(
    "text", ["", ":Load", "Goods in:", "@", "@1", "@1,2,3,4", "@a,b", "@1,2,99", "@nan,0", "@1,2:", "@1:NOP"]
)
def test_invalid_stop_is_reported(text: str) -> None:
    with pytest.raises(typer.BadParameter, match="Invalid"):
        parse_stop(text)


def test_coordinate_and_property_are_read() -> None:
    assert parse_coordinate("1,2") == Coordinate(x=1.0, y=2.0)
    assert parse_property("a=b=c") == Property(key="a", value="b=c")
    for text in ("a", "=b"):
        with pytest.raises(typer.BadParameter, match="Invalid property"):
            parse_property(text)


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
    with pytest.raises(typer.BadParameter, match="Invalid measure"):
        parse_measure(text)
