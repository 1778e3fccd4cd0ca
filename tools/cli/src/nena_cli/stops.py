"""``nena stops``: pause all robots, or those in an area, until a person ends the stop."""

from __future__ import annotations

from getpass import getuser
from typing import Annotated

import typer
from pydantic import JsonValue, ValidationError

from nena_cli import tables
from nena_cli.options import group
from nena_cli.service import Service, of_service
from nena_shared.fleet_api.operations.fleet import END_STOP, LIST_STOPS, STOP
from nena_shared.fleet_api.stops import Area
from nena_shared.vda5050.malformed import problems_of

app = group()

Reason = Annotated[str, typer.Argument(help="Why the robots pause.")]
By = Annotated[str | None, typer.Option(help="Name of the person. Unset: your user name.")]
CORNERS = 4
"""Numbers of an area."""


@app.command("list")
@of_service
def list_(service: Service) -> None:
    """List the active stops, and the robots that are not paused."""
    service.print_all(tables.stops_table, *service.call(LIST_STOPS).stops)


@app.command("all")
@of_service
def all_(service: Service, reason: Reason, *, by: By = None) -> None:
    """Pause all robots until the stop is ended."""
    _begin_stop(service, {"by": by or getuser(), "reason": reason})


@app.command(context_settings={"ignore_unknown_options": True})  # a negative XMIN is no option
@of_service
def area(
    service: Service,
    corners: Annotated[str, typer.Argument(help="XMIN,YMIN,XMAX,YMAX, m in the plant frame.")],
    reason: Reason,
    *,
    map_id: Annotated[str | None, typer.Option("--map", help="Map of the area. Unset: all maps.")] = None,
    by: By = None,
) -> None:
    """Pause the robots in an area, and keep others out, until the stop is ended."""
    where = _parse_area(corners, map_id).model_dump(mode="json", by_alias=True, exclude_none=True)
    _begin_stop(service, {"by": by or getuser(), "reason": reason, "area": where})


@app.command()
@of_service
def end(
    service: Service,
    name: Annotated[str, typer.Argument(help="Name of the stop.")],
    *,
    reason: Annotated[str, typer.Option(help="Why the stop ends.")] = "no reason given",
    by: By = None,
) -> None:
    """End a stop: the robots that it has paused continue."""
    done = service.call(END_STOP, name, body={"by": by or getuser(), "reason": reason})
    service.print_all(tables.stops_table, done)


def _begin_stop(service: Service, body: dict[str, JsonValue]) -> None:
    service.print_all(tables.stops_table, service.call(STOP, body=body))


def _parse_area(corners: str, map_id: str | None) -> Area:
    """Parse ``XMIN,YMIN,XMAX,YMAX``; raises typer.BadParameter."""
    numbers = corners.split(",")
    if len(numbers) != CORNERS:
        raise typer.BadParameter(f"Invalid area {corners!r}: use XMIN,YMIN,XMAX,YMAX in m")
    names = ("x_min", "y_min", "x_max", "y_max")
    try:
        return Area.model_validate({**dict(zip(names, numbers, strict=True)), "map_id": map_id})
    except ValidationError as error:
        raise typer.BadParameter(f"Invalid area {corners!r}: {'; '.join(problems_of(error))}") from error
