"""``nena peripherals``: doors, lifts and other peripheral devices at a running order service."""

from __future__ import annotations

from typing import Annotated

import typer

from nena_cli import tables
from nena_cli.options import group
from nena_cli.service import Service, of_service
from nena_shared.fleet_api.operations.peripherals import CREATE_JOB, LIST_JOBS, LIST_PERIPHERALS, WITHDRAW_JOB
from nena_shared.fleet_api.peripherals import PeripheralJobRequest

app = group()


@app.command("list")
@of_service
def list_(service: Service) -> None:
    """List the peripheral devices."""
    with service.connected() as connection:
        found = connection.call(LIST_PERIPHERALS)
    service.print_all(found.peripherals, tables.peripherals_table)


@app.command()
@of_service
def jobs(service: Service) -> None:
    """List the unfinished jobs and the last ended ones, newest first."""
    with service.connected() as connection:
        found = connection.call(LIST_JOBS)
    service.print_all(found.peripheral_jobs, tables.peripheral_jobs_table)


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
    request = PeripheralJobRequest(location=location, operation=operation, reservation_token=reservation)
    body = request.model_dump(mode="json", by_alias=True, exclude_none=True)
    with service.connected() as connection:
        job = connection.call(CREATE_JOB, body=body)
    service.print_all((job,), tables.peripheral_jobs_table)


@app.command()
@of_service
def withdraw(
    service: Service, job: Annotated[str, typer.Argument(help="Name of the peripheral job.")]
) -> None:
    """Withdraw a job; a vehicle that requires it fails its drive."""
    with service.connected() as connection:
        done = connection.call(WITHDRAW_JOB, job, body={})
    service.print_all((done,), tables.peripheral_jobs_table)
