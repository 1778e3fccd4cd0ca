"""Stops of an order as people write them."""

from __future__ import annotations

import typer

from nena_shared.fleet_api.transport_order import Coordinate, Destination, Property

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
