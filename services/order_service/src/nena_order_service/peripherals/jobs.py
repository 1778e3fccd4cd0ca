"""Peripheral jobs: one operation of one device, with its states."""

from __future__ import annotations

from datetime import datetime
from typing import NamedTuple, Self

from pydantic import BaseModel, ConfigDict

from nena_shared.fleet_api.peripherals import DeviceRequest, PeripheralJobState, PeripheralJobStatus
from nena_shared.fleet_api.reasons import Reason, explained
from nena_shared.plant_terms import ExecutionTrigger


class JobKey(NamedTuple):
    """The place of an operation on a vehicle's route; there is one job for each.

    ``step`` counts the paths of the VDA order from 0; -1: the operation belongs to the destination. ``place``
    counts the operations of the path or destination.
    """

    order_id: str
    step: int
    path: str
    place: int


class PeripheralJob(BaseModel):
    """A peripheral job, as stored."""

    model_config = ConfigDict(frozen=True)

    number: int
    """Jobs are numbered in the order of their creation."""
    status: PeripheralJobStatus
    order_id: str = ""
    """VDA 5050 order whose route needs it; empty: requested by a host."""
    step: int = -1
    place: int = 0

    @property
    def name(self) -> str:
        """Its name."""
        return self.status.name

    @property
    def key(self) -> JobKey | None:
        """The place on a route; None: requested by a host."""
        if not self.order_id:
            return None
        return JobKey(self.order_id, self.step, self.status.path or "", self.place)

    @property
    def over(self) -> bool:
        """Whether it has ended."""
        return self.status.state.final

    @property
    def done(self) -> bool:
        """Whether its device has executed it."""
        return self.status.state is PeripheralJobState.FINISHED

    @property
    def after_movement(self) -> bool:
        """Whether it starts after a movement, and is therefore needed even if its route has ended."""
        return self.status.execution_trigger is ExecutionTrigger.AFTER_MOVEMENT

    def begun(self) -> Self:
        """Return the job as sent to its device."""
        return self._with_status(state=PeripheralJobState.BEING_PROCESSED)

    def finished(self, now: datetime) -> Self:
        """Return the job as executed."""
        return self._with_status(state=PeripheralJobState.FINISHED, finished=now)

    def failed(self, reason: Reason, now: datetime) -> Self:
        """Return the job as failed."""
        return self._with_status(state=PeripheralJobState.FAILED, finished=now, **explained(reason))

    def request(self, now: datetime) -> DeviceRequest:
        """Return the message to its device."""
        status = self.status
        return DeviceRequest(
            job_id=status.name,
            operation=status.operation,
            execution_trigger=status.execution_trigger,
            completion_required=status.completion_required,
            vehicle=status.related_vehicle,
            transport_order=status.related_transport_order,
            path=status.path,
            timestamp=now,
        )

    def _with_status(self, **changes: object) -> Self:
        return self.model_copy(update={"status": self.status.model_copy(update=changes)})
