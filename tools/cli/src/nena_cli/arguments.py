"""Arguments and options of orders, and parsing of their texts."""

from __future__ import annotations

from collections.abc import Collection
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
"""Numbers of a coordinate with heading."""


def parse_stop(text: str) -> Destination:
    """Parse ``NAME``, ``@X,Y`` or ``@X,Y,THETA`` (m and rad in the plant frame), and ``:OPERATION``, if any.

    Without an operation the order service chooses one: MOVE at a point, NOP at a location.

    Raises:
        typer.BadParameter: the text has another form.
    """
    name, colon, operation = text.rpartition(":")
    if operation and not colon:
        name = operation
    if not name or not operation:
        raise typer.BadParameter(f"Invalid stop {text!r}: use NAME, NAME:OPERATION or @X,Y,THETA")
    place: dict[str, object] = {"location_name": name}
    if name.startswith(COORDINATE):
        place = {"coordinate": parse_coordinate(name.removeprefix(COORDINATE))}
    return Destination.model_validate(place | ({"operation": operation} if colon else {}))


def parse_coordinate(text: str) -> Coordinate:
    """Parse ``X,Y`` or ``X,Y,THETA``; raises typer.BadParameter."""
    try:
        numbers: list[float | None] = [float(part) for part in text.split(",")]
        x, y, theta = numbers if len(numbers) == WITH_HEADING else [*numbers, None]
        return Coordinate.model_validate({"x": x, "y": y, "theta": theta})
    except ValueError as error:
        raise typer.BadParameter(
            f"Invalid coordinate {text!r}: use X,Y or X,Y,THETA in m and rad (-3.14 to 3.14)"
        ) from error


def parse_property(text: str) -> Property:
    """Parse ``KEY=VALUE``; raises typer.BadParameter."""
    key, equals, value = text.partition("=")
    if not equals or not key:
        raise typer.BadParameter(f"Invalid property {text!r}: use KEY=VALUE")
    return Property(key=key, value=value)


FIELDS = ("do", "times", "after")


def parse_measure(text: str) -> FailureStep:
    """Parse ``MEASURE``, ``MEASURE:TIMES`` or ``MEASURE:TIMES:SECONDS``, such as ``RETRY:2:5``.

    Raises:
        typer.BadParameter: the text has another form.
    """
    parts = text.split(":")
    if len(parts) > len(FIELDS):
        raise typer.BadParameter(f"Invalid measure {text!r}: use MEASURE:TIMES:SECONDS")
    try:
        return FailureStep.model_validate(dict(zip(FIELDS, [parts[0].upper(), *parts[1:]], strict=False)))
    except ValidationError as error:
        raise typer.BadParameter(f"Invalid measure {text!r}: {'; '.join(problems_of(error))}") from error


def refuse_beside_file(given: Collection[str]) -> None:
    """Raise typer.BadParameter if there are options of an order beside a file that contains the order."""
    if given:
        raise typer.BadParameter(f"--file contains the whole order: set {', '.join(given)} there instead")


Stops = Annotated[
    list[str] | None,
    typer.Argument(metavar="STOP", help="NAME, NAME:OPERATION or @X,Y,THETA, in driving order."),
]
File = Annotated[
    typer.FileBinaryRead | None,
    typer.Option("--file", metavar="FILE", help="JSON file with the request; - for standard input."),
]
NewName = Annotated[str | None, typer.Option(help="Name (optional).")]
Vehicle = Annotated[str | None, typer.Option(help="Assign to this vehicle only.")]
Priority = Annotated[int, typer.Option(help="Priority; higher is more urgent.")]
Deadline = Annotated[datetime | None, typer.Option(help="Deadline in local time.")]
Type = Annotated[str, typer.Option("--type", help="Order type.")]
Dispensable = Annotated[
    bool, typer.Option("--dispensable", help="Allow withdrawal in favour of other orders.")
]
Dependencies = Annotated[
    list[str] | None,
    typer.Option("--after", metavar="NAME", help="Order that must be FINISHED first; repeatable."),
]
OnDependencyFailure = Annotated[
    DependencyFailure, typer.Option(help="What to do if one of these orders fails.")
]
Sequence = Annotated[str | None, typer.Option("--sequence", help="Order sequence to add the order to.")]
Properties = Annotated[
    list[str] | None, typer.Option("--property", metavar="KEY=VALUE", help="Property; repeatable.")
]
OnFailure = Annotated[
    list[str] | None,
    typer.Option(
        "--on-failure",
        metavar="MEASURE",
        help="MEASURE, MEASURE:TIMES or MEASURE:TIMES:SECONDS; repeatable, tried in this order.",
    ),
]
Timeout = Annotated[
    float | None, typer.Option(help="Cancel the order if unfinished after this many seconds.")
]
ProcessingTimeout = Annotated[
    float | None, typer.Option(help="The same, counted from its first assignment to a vehicle.")
]
Key = Annotated[
    str | None, typer.Option("--key", help="Idempotency key: repeated requests create no second order.")
]
Wait = Annotated[bool, typer.Option("--wait", help="Watch the order to its end; status 1 if it fails.")]
