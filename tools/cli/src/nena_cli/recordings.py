"""``nena recordings``: recordings of robots and of the order service, at the status aggregator."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated, Final
from urllib.parse import quote

import typer
from pydantic import BaseModel, TypeAdapter

from nena_cli.aggregator import DEFAULT_AGGREGATOR, Aggregator, check_answer, connect_aggregator
from nena_cli.options import group
from nena_cli.service import Service, of_service, vehicle_names
from nena_cli.styled import Table
from nena_cli.vehicles import act
from nena_shared.fleet_api.operations.fleet import FETCH_RECORDING
from nena_shared.fleet_api.recordings import RecordingAnswer
from nena_shared.vda5050 import own_actions

app = group()

KIB: Final = 1024

Robot = Annotated[str, typer.Argument(metavar="ROBOT", help="Manufacturer and serial number: ACME/r1.")]


class RecordingRow(BaseModel):
    """A recording as the status aggregator lists it."""

    robot: str
    name: str
    size: int
    received: datetime


_ROWS: Final = TypeAdapter(list[RecordingRow])


@app.command("list")
@of_service
def list_(
    service: Service,
    *,
    robot: Annotated[str | None, typer.Option(help="Only recordings of this robot, such as ACME/r1.")] = None,
    aggregator: Aggregator = DEFAULT_AGGREGATOR,
) -> None:
    """List recordings and log reports, newest first."""
    with connect_aggregator(service, aggregator) as client:
        answer = client.get("/api/v1/recordings", params={"robot": robot} if robot else None)
        check_answer(answer)
        found = _ROWS.validate_json(answer.content)
    service.print_all(recordings_table, *found)


@app.command()
@of_service
def get(
    service: Service,
    robot: Robot,
    name: Annotated[str, typer.Argument(help="Name of the file, from nena recordings list.")],
    *,
    to: Annotated[
        Path | None, typer.Option("--to", metavar="FILE", help="File to write. Unset: NAME, here.")
    ] = None,
    aggregator: Aggregator = DEFAULT_AGGREGATOR,
) -> None:
    """Download a recording; Foxglove opens it."""
    path = "/".join(quote(each, safe="") for each in (*robot.split("/"), name))
    target = to or Path(Path(name).name)
    with (
        connect_aggregator(service, aggregator) as client,
        client.stream("GET", f"/api/v1/recordings/{path}") as answer,
    ):
        if answer.is_error:
            answer.read()
        check_answer(answer)
        with target.open("wb") as file:
            for part in answer.iter_bytes():
                file.write(part)
    typer.echo(str(target))


@app.command()
@of_service
def request(
    service: Service,
    name: Annotated[
        str | None,
        typer.Argument(
            help="Name of the vehicle. Unset: the order service.",
            autocompletion=vehicle_names,
            show_default=False,
        ),
    ] = None,
) -> None:
    """Make a robot or the order service write its last minutes to a file and send it; print its name."""
    if name is not None:
        act(service, name, own_actions.FETCH_RECORDING, {})
        return
    answer = service.call(FETCH_RECORDING)
    service.print_one(answer, requested_table(answer))


def requested_table(found: RecordingAnswer) -> Table:
    """Return the table of a requested recording."""
    table = Table("robot", "name", "sent")
    table.add_row(found.robot, found.name, "yes" if found.sent else "no")
    return table


def recordings_table(found: Sequence[RecordingRow]) -> Table:
    """Return the table of recordings."""
    table = Table("robot", "name", "KiB", "received")
    for each in found:
        received = f"{each.received.astimezone():%Y-%m-%d %H:%M:%S}"
        table.add_row(each.robot, each.name, str(-(-each.size // KIB)), received)
    return table
