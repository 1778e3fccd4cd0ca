"""The options that say what a new transport order is to be."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

import typer

from nena_shared.fleet_api.transport_order import DependencyFailure

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
