"""``nena recordings``: recordings of robots and of the order service, at the status aggregator."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import Annotated, Final
from urllib.parse import quote

import httpx
import typer
from pydantic import BaseModel, TypeAdapter, ValidationError
from rich.text import Text

from nena_cli.options import group
from nena_cli.output import REFUSED, fail
from nena_cli.service import Service, of_service, vehicle_names
from nena_cli.styled import Table
from nena_cli.tables import printable
from nena_cli.vehicles import act
from nena_shared.fleet_api.operations.fleet import FETCH_RECORDING
from nena_shared.fleet_api.recordings import RecordingAnswer
from nena_shared.vda5050 import own_actions

app = group()

DEFAULT_AGGREGATOR: Final = "http://127.0.0.1:8080"
TIMEOUT: Final = 30.0
"""Timeout of each step of a request, seconds."""
KIB: Final = 1024

Aggregator = Annotated[
    str,
    typer.Option(
        "--aggregator", envvar="NENA_AGGREGATOR_URL", metavar="URL", help="URL of the status aggregator."
    ),
]
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
    with _connect_aggregator(service, aggregator) as client:
        answer = client.get("/api/v1/recordings", params={"robot": robot} if robot else None)
        _check_answer(answer)
        found = _ROWS.validate_json(answer.content)
    service.print_all(found, recordings_table)


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
        _connect_aggregator(service, aggregator) as client,
        client.stream("GET", f"/api/v1/recordings/{path}") as answer,
    ):
        if answer.is_error:
            answer.read()
        _check_answer(answer)
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
    with service.connected() as connection:
        answer = connection.call(FETCH_RECORDING)
    service.print_one(answer, requested_table(answer))


def requested_table(found: RecordingAnswer) -> Table:
    """Return the table of a requested recording."""
    table = Table("robot", "name", "sent")
    table.add_row(Text(found.robot), Text(found.name), Text("yes" if found.sent else "no"))
    return table


def recordings_table(found: Sequence[RecordingRow]) -> Table:
    """Return the table of recordings."""
    table = Table("robot", "name", "KiB", "received")
    for each in found:
        received = f"{each.received.astimezone():%Y-%m-%d %H:%M:%S}"
        table.add_row(Text(each.robot), Text(each.name), Text(str(-(-each.size // KIB))), Text(received))
    return table


@contextmanager
def _connect_aggregator(service: Service, url: str) -> Iterator[httpx.Client]:
    """Connect to the status aggregator; report an error in one line and exit."""
    token = service.access_token()
    headers = {"authorization": f"Bearer {token}"} if token else {}
    try:
        with httpx.Client(base_url=url, headers=headers, timeout=TIMEOUT) as client:
            yield client
    except ValidationError:
        fail(f"{url} is not a status aggregator. Set --aggregator or NENA_AGGREGATOR_URL.")
    except (httpx.HTTPError, httpx.InvalidURL, OSError) as error:
        fail(f"Cannot connect to the status aggregator. Set --aggregator or NENA_AGGREGATOR_URL.\n{error}")


def _check_answer(answer: httpx.Response) -> None:
    """Report a refusal and exit."""
    if answer.is_success:
        return
    try:
        detail = str(answer.json()["detail"])
    except (ValueError, KeyError, TypeError):
        detail = f"{answer.url} answered {answer.status_code}; is it a status aggregator?"
    fail(printable(detail), REFUSED)
