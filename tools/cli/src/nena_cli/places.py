"""``nena points``, ``paths`` and ``locations``: the plant model at a running order service."""

from __future__ import annotations

from typing import Annotated

import typer

from nena_cli import tables
from nena_cli.options import group
from nena_cli.service import Service, names, of_service, vehicle_names
from nena_client.exchange import Query
from nena_shared.fleet_api.operations.plant import (
    LIST_LOCATIONS,
    LIST_PATHS,
    LIST_POINTS,
    LOCK_PATH,
    PREVIEW_PATH_LOCK,
    SHOW_LOCATION,
    SHOW_POINT,
)
from nena_shared.plant_terms import PointType

points = group()
paths = group()
locations = group()


def point_names(context: typer.Context, incomplete: str) -> list[str]:
    """Return the names of points for the shell's completion, as :func:`vehicle_names`."""
    return names(
        context,
        incomplete,
        lambda connection: [each for page in connection.pages(LIST_POINTS) for each in page.points],
    )


def location_names(context: typer.Context, incomplete: str) -> list[str]:
    """Return the names of locations for the shell's completion, as :func:`vehicle_names`."""
    return names(
        context,
        incomplete,
        lambda connection: [each for page in connection.pages(LIST_LOCATIONS) for each in page.locations],
    )


def path_names(context: typer.Context, incomplete: str) -> list[str]:
    """Return the names of paths for the shell's completion, as :func:`vehicle_names`."""
    return names(context, incomplete, lambda connection: list(connection.call(LIST_PATHS).paths))


PathName = Annotated[str, typer.Argument(help="Name of the path.", autocompletion=path_names)]
PointName = Annotated[str, typer.Argument(help="Name of the point.", autocompletion=point_names)]
LocationName = Annotated[str, typer.Argument(help="Name of the location.", autocompletion=location_names)]


@points.command("list")
@of_service
def list_points(
    service: Service,
    *,
    type_: Annotated[
        list[PointType] | None, typer.Option("--type", help="Only points of this type; repeatable.")
    ] = None,
    map_id: Annotated[str | None, typer.Option("--map", help="Only points on this map.")] = None,
    vehicle: Annotated[
        str | None,
        typer.Option(
            help="Only points where this vehicle stands, or that are reserved for it.",
            autocompletion=vehicle_names,
        ),
    ] = None,
) -> None:
    """List the points, with the vehicles that stand there or for which they are reserved."""
    query: Query = {"type": type_, "mapId": map_id, "vehicle": vehicle}
    with service.connected() as connection:
        found = [each for page in connection.pages(LIST_POINTS, query) for each in page.points]
    service.print_all(tables.points_table, *found)


@points.command("show")
@of_service
def show_point(service: Service, name: PointName) -> None:
    """Show a point, and the vehicles that stand there or for which it is reserved."""
    service.print_all(tables.points_table, service.call(SHOW_POINT, name))


@paths.command("list")
@of_service
def list_paths(
    service: Service,
    *,
    locked: Annotated[bool | None, typer.Option("--locked/--unlocked", help="Only such paths.")] = None,
) -> None:
    """List the paths, and which of them are locked."""
    service.print_all(tables.paths_table, *service.call(LIST_PATHS, query={"locked": locked}).paths)


@paths.command("lock")
@of_service
def lock_path(
    service: Service,
    name: PathName,
    *,
    check: Annotated[bool, typer.Option("--check", help="Only show what would have no other route.")] = False,
) -> None:
    """Lock a path: new routes avoid it, also those of driving vehicles."""
    if check:
        service.print_all(tables.lock_previews_table, service.call(PREVIEW_PATH_LOCK, name))
    else:
        service.print_all(tables.paths_table, service.call(LOCK_PATH, name, body={"locked": True}))


@paths.command("unlock")
@of_service
def unlock_path(service: Service, name: PathName) -> None:
    """Unlock a path."""
    service.print_all(tables.paths_table, service.call(LOCK_PATH, name, body={"locked": False}))


@locations.command("list")
@of_service
def list_locations(
    service: Service,
    *,
    type_: Annotated[str | None, typer.Option("--type", help="Only locations of this type.")] = None,
    point: Annotated[
        str | None, typer.Option(help="Only locations linked to this point.", autocompletion=point_names)
    ] = None,
    operation: Annotated[
        str | None, typer.Option(help="Only locations that offer this operation of vehicles.")
    ] = None,
) -> None:
    """List the locations, with the operations that they offer and the points to which they are linked."""
    query: Query = {"type": type_, "point": point, "operation": operation}
    with service.connected() as connection:
        found = [each for page in connection.pages(LIST_LOCATIONS, query) for each in page.locations]
    service.print_all(tables.locations_table, *found)


@locations.command("show")
@of_service
def show_location(service: Service, name: LocationName) -> None:
    """Show a location: what it offers, and from which points it is served."""
    service.print_all(tables.locations_table, service.call(SHOW_LOCATION, name))
