"""Lists of peripheral jobs: by time of creation, and in pages."""

from __future__ import annotations

from datetime import timedelta

import pytest

from nena_order_service.api.peripherals import PeripheralOperations
from nena_order_service.errors import UnknownError
from nena_shared.fleet_api.peripherals import PeripheralJobRequest, PeripheralJobsQuery
from nena_shared.plant import ExecutionTrigger
from support.clocks import ManualClock
from support.doors import hall, operation, started

MINUTE = timedelta(minutes=1)


async def four_jobs(clock: ManualClock) -> PeripheralOperations:
    """Create jobs J-0 to J-3, a minute apart."""
    site = await started(hall(operation("open", ExecutionTrigger.AFTER_ALLOCATION)), clock=clock)
    requests = PeripheralOperations(site.engine)
    asked = PeripheralJobRequest(location="Door", operation="open", reservation_token="host")
    for number in range(4):
        site.engine.create_peripheral_job(asked, f"J-{number}")
        clock.advance(60)
    await site.engine.unit_of_work.wait_committed()
    return requests


async def test_jobs_are_found_by_their_time_of_creation() -> None:
    clock = ManualClock()
    requests = await four_jobs(clock)

    def names(**query: object) -> list[str]:
        return [
            each.name
            for each in requests.list_jobs(PeripheralJobsQuery.model_validate(query)).peripheral_jobs
        ]

    assert names() == ["J-3", "J-2", "J-1", "J-0"]
    assert names(since=clock.start + MINUTE) == ["J-3", "J-2", "J-1"]
    assert names(until=clock.start + MINUTE) == ["J-0"]
    assert names(since=clock.start + MINUTE, until=clock.start + 3 * MINUTE) == ["J-2", "J-1"]


async def test_a_page_follows_the_job_that_the_previous_one_names() -> None:
    requests = await four_jobs(ManualClock())

    def names(**query: object) -> list[str]:
        return [
            each.name
            for each in requests.list_jobs(PeripheralJobsQuery.model_validate(query)).peripheral_jobs
        ]

    assert names(limit=2) == ["J-3", "J-2"]
    assert names(limit=2, after="J-2") == ["J-1", "J-0"]
    with pytest.raises(UnknownError):
        names(after="J-9")
