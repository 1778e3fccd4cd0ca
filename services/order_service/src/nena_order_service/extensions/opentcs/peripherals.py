"""Peripheral jobs and devices in openTCS's web API."""

from __future__ import annotations

from typing import Annotated, Any, Final

from fastapi import FastAPI, Query, Response
from pydantic import Field
from starlette.exceptions import HTTPException

from nena_order_service.api.hosts import HostServices
from nena_order_service.api.peripherals import PeripheralOperations
from nena_order_service.engine.engine import Engine
from nena_order_service.extensions.opentcs.answers import Body, NotPossibleError
from nena_order_service.extensions.opentcs.events import peripheral_job
from nena_order_service.orders.transport_order import sortable_id
from nena_shared.fleet_api.peripherals import PeripheralJobRequest, PeripheralJobsQuery

DRIVER: Final = "nena.mqtt"
"""Name of the only peripheral driver; openTCS names drivers by class."""

NOT_FOUND: Final = 404


class JobOperation(Body):
    """The operation of a job. As in openTCS, hosts create only IMMEDIATE jobs without completionRequired."""

    operation: Annotated[str, Field(min_length=1, max_length=200)]
    location_name: Annotated[str, Field(min_length=1, max_length=200)]


class JobRequest(Body):
    """Request for a peripheral job; its name is in the path."""

    incomplete_name: bool = False
    reservation_token: Annotated[str, Field(min_length=1, max_length=200)]
    peripheral_operation: JobOperation


def _add_jobs(app: FastAPI, hosts: HostServices, engine: Engine) -> None:
    peripherals = hosts.peripherals

    @app.get("/v1/peripheralJobs")
    async def list_jobs(
        vehicle: Annotated[str | None, Query(alias="relatedVehicle")] = None,
        order: Annotated[str | None, Query(alias="relatedTransportOrder")] = None,
    ) -> list[dict[str, Any]]:
        if vehicle is not None:
            hosts.vehicles.find_status(vehicle)
        if order is not None:
            await hosts.orders.find_status(order)
        jobs = peripherals.list_jobs(PeripheralJobsQuery(vehicle=vehicle, transport_order=order))
        return [peripheral_job(job) for job in jobs.peripheral_jobs]

    @app.post("/v1/peripheralJobs/dispatcher/trigger", response_class=Response)
    @app.post("/v1/peripherals/dispatcher/trigger", response_class=Response)
    async def trigger() -> None:
        engine.run_checks()

    @app.get("/v1/peripheralJobs/{name}")
    async def show_job(name: str) -> dict[str, Any]:
        return peripheral_job(peripherals.find_job(name))

    @app.post("/v1/peripheralJobs/{name}")
    async def create_job(name: str, body: JobRequest) -> dict[str, Any]:
        asked = PeripheralJobRequest(
            name=f"{name}{sortable_id()}" if body.incomplete_name else name,
            location=body.peripheral_operation.location_name,
            operation=body.peripheral_operation.operation,
            reservation_token=body.reservation_token,
        )
        return peripheral_job(await peripherals.create_job(asked))

    @app.post("/v1/peripheralJobs/{name}/withdrawal", response_class=Response)
    async def withdraw_job(name: str) -> None:
        if not peripherals.find_job(name).state.final:
            await peripherals.withdraw_job(name, "by a host")


def _add_devices(app: FastAPI, peripherals: PeripheralOperations, engine: Engine) -> None:
    def has_device(name: str) -> bool:
        if name not in engine.plant.locations_by_name:
            raise HTTPException(NOT_FOUND, f"Could not find location {name!r}.")
        return name in engine.peripherals.operations

    @app.post("/v1/peripherals/{name:path}/withdrawal", response_class=Response)
    async def withdraw(name: str) -> None:
        if has_device(name) and (job := peripherals.find_status(name).job):
            await peripherals.withdraw_job(job.name, "by a host")

    @app.get("/v1/peripherals/{name:path}/commAdapter/attachmentInformation")
    async def attachment(name: str) -> dict[str, Any]:
        return {"locationReference": name, "attachedCommAdapter": DRIVER if has_device(name) else ""}

    @app.put("/v1/peripherals/{name:path}/commAdapter/attachment", response_class=Response)
    async def attach(name: str, new_value: Annotated[str, Query(alias="newValue")]) -> None:
        if not has_device(name) or new_value != DRIVER:
            raise NotPossibleError(f"Unknown peripheral driver class name: {new_value}")

    @app.put("/v1/peripherals/{name:path}/commAdapter/enabled", response_class=Response)
    async def enable(name: str, new_value: Annotated[bool, Query(alias="newValue")]) -> None:
        if has_device(name) != new_value:
            raise NotPossibleError(
                f"Location {name!r} has no peripheral driver."
                if new_value
                else f"The peripheral driver of location {name!r} is always enabled."
            )


def add_routes(app: FastAPI, hosts: HostServices, engine: Engine) -> None:
    """Add the paths of peripheral jobs and devices."""
    _add_jobs(app, hosts, engine)
    _add_devices(app, hosts.peripherals, engine)
