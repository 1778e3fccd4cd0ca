"""Arguments and options of orders, and how their texts are read."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

import typer
from pydantic import ValidationError

from nena_shared.fleet_api.transport_order import (
    Coordinate,
    DependencyFailure,
    Destination,
    FailureStep,
    Property,
)
from nena_shared.vda5050.malformed import problems_of

COORDINATE = "@"

WITH_HEADING = 3
"""Numbers of a coordinate that says which way to look."""


def parse_stop(text: str) -> Destination:
    """Read ``NAME``, ``NAME:OPERATION`` or ``@X,Y`` or ``@X,Y,THETA`` (m and rad of the plant's frame).

    Raises:
        typer.BadParameter: it is none of these.

    """
    if text.startswith(COORDINATE):
        return Destination(coordinate=parse_coordinate(text.removeprefix(COORDINATE)))
    name, colon, operation = text.rpartition(":")
    if not colon:
        name, operation = operation, "MOVE"
    if not name or not operation:
        message = f"{text!r} is no stop: give NAME, NAME:OPERATION, or @X,Y,THETA"
        raise typer.BadParameter(message)
    return Destination(location_name=name, operation=operation)


def parse_coordinate(text: str) -> Coordinate:
    """Read ``X,Y`` or ``X,Y,THETA``; raises typer.BadParameter."""
    try:
        numbers: list[float | None] = [float(part) for part in text.split(",")]
        x, y, theta = numbers if len(numbers) == WITH_HEADING else [*numbers, None]
        return Coordinate.model_validate({"x": x, "y": y, "theta": theta})
    except ValueError as error:
        message = f"{text!r} is no coordinate: give X,Y or X,Y,THETA in m and rad (-3.14 to 3.14)"
        raise typer.BadParameter(message) from error


def parse_property(text: str) -> Property:
    """Read ``KEY=VALUE``; raises typer.BadParameter."""
    key, equals, value = text.partition("=")
    if not equals or not key:
        message = f"{text!r} is no property: give KEY=VALUE"
        raise typer.BadParameter(message)
    return Property(key=key, value=value)


FIELDS = ("do", "times", "after")


def parse_measure(text: str) -> FailureStep:
    """Read ``MEASURE``, ``MEASURE:TIMES`` or ``MEASURE:TIMES:SECONDS``, such as ``RETRY:2:5``.

    Raises:
        typer.BadParameter: it is none of these.

    """
    parts = text.split(":")
    if len(parts) > len(FIELDS):
        message = f"{text!r} is no measure: give MEASURE:TIMES:SECONDS"
        raise typer.BadParameter(message)
    try:
        return FailureStep.model_validate(dict(zip(FIELDS, [parts[0].upper(), *parts[1:]], strict=False)))
    except ValidationError as error:
        message = f"{text!r} is no measure: {'; '.join(problems_of(error))}"
        raise typer.BadParameter(message) from error


Stops = Annotated[
    list[str] | None, typer.Argument(help="NAME, NAME:OPERATION or @X,Y,THETA, in the order of driving.")
]
File = Annotated[
    typer.FileBinaryRead | None,
    typer.Option("--file", help="The whole request as JSON; - is standard input."),
]
NewName = Annotated[str | None, typer.Option(help="Name; without one the order service makes one.")]
Vehicle = Annotated[str | None, typer.Option(help="Only this vehicle does it.")]
Priority = Annotated[int, typer.Option(help="Greater is more urgent.")]
Deadline = Annotated[datetime | None, typer.Option(help="When it is due, in local time.")]
Type = Annotated[str, typer.Option("--type", help="Type of the order.")]
Dispensable = Annotated[
    bool, typer.Option("--dispensable", help="It may be dropped when something better comes.")
]
Dependencies = Annotated[
    list[str] | None, typer.Option("--after", help="Order that must be FINISHED first; several times.")
]
OnDependencyFailure = Annotated[
    DependencyFailure, typer.Option(help="What becomes of it when one of these fails.")
]
Sequence = Annotated[str | None, typer.Option("--sequence", help="Order sequence to which it is added.")]
Properties = Annotated[
    list[str] | None, typer.Option("--property", help="KEY=VALUE; several times if wanted.")
]
OnFailure = Annotated[
    list[str] | None,
    typer.Option(
        "--on-failure",
        help="MEASURE, MEASURE:TIMES or MEASURE:TIMES:SECONDS; several times, in their order.",
    ),
]
Timeout = Annotated[float | None, typer.Option(help="Seconds after which it is cancelled if it is not done.")]
ProcessingTimeout = Annotated[
    float | None, typer.Option(help="The same, from when it is first given to a vehicle.")
]
Key = Annotated[
    str | None, typer.Option("--key", help="Idempotency key: the same again makes no second order.")
]
Wait = Annotated[bool, typer.Option("--wait", help="Watch it to its end; status 1 if it fails.")]
