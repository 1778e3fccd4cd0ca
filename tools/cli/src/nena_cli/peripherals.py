"""``nena peripherals``: doors, lifts and other peripheral devices at a running order service."""

from __future__ import annotations

from typing import Annotated

import typer
from pydantic import JsonValue

from nena_cli import tables
from nena_cli.options import group
from nena_cli.service import Service, of_service
from nena_shared.fleet_api.operations.peripherals import CREATE_JOB, LIST_JOBS, LIST_PERIPHERALS, WITHDRAW_JOB

app = group()


@app.command("list")
@of_service
def list_(service: Service) -> None:
    """List the peripheral devices."""
    service.print_all(tables.peripherals_table, *service.call(LIST_PERIPHERALS).peripherals)


@app.command()
@of_service
def jobs(service: Service) -> None:
    """List the unfinished jobs and the last ended ones, newest first."""
    service.print_all(tables.peripheral_jobs_table, *service.call(LIST_JOBS).peripheral_jobs)


@app.command()
@of_service
def run(
    service: Service,
    location: Annotated[str, typer.Argument(help="Location of the device.")],
    operation: Annotated[str, typer.Argument(help="Operation, such as open.")],
    reservation: Annotated[
        str, typer.Option(help="Reservation token; a vehicle's name to act while it uses the device.")
    ] = "nena",
) -> None:
    """Create a job; it waits while a vehicle uses the device."""
    body: dict[str, JsonValue] = {
        "location": location,
        "operation": operation,
        "reservationToken": reservation,
    }
    service.print_all(tables.peripheral_jobs_table, service.call(CREATE_JOB, body=body))


@app.command()
@of_service
def withdraw(
    service: Service, job: Annotated[str, typer.Argument(help="Name of the peripheral job.")]
) -> None:
    """Withdraw a job; a vehicle that requires it fails its drive."""
    service.print_all(tables.peripheral_jobs_table, service.call(WITHDRAW_JOB, job, body={}))
