"""Stops that the status aggregator has begun without this service: continued, recorded, and cleared.

They are retained at the broker, with the robots that they have paused. A stop that has ended meanwhile is
only recorded in the audit trail.
"""

from __future__ import annotations

import asyncio
from functools import partial
from typing import Final

from pydantic import ValidationError

from nena_order_service.api.audit import ChangingRequest, Origin, Trail, serialiser_of
from nena_order_service.engine.engine import Engine
from nena_order_service.errors import StoreNotReadyError
from nena_shared.fleet_api.audit import AuditInterface
from nena_shared.fleet_api.operations.fleet import END_STOP, STOP
from nena_shared.fleet_api.stops import DirectStop
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.tasks import end, report_failure

log = get_logger(__name__)

SETTLED_AFTER: Final = 1.0
"""Seconds to wait: a service that hung first executes the request that the aggregator has given up."""

STORE_RETRY: Final = 2.0
"""Seconds between attempts while the store cannot be written."""

CLIENT: Final = "nena-panel, without the order service"
"""Client of these requests in the audit trail."""


class DirectStopTakeover:
    """Continues the stops of the status aggregator."""

    def __init__(self, mqtt: MqttLink, topics: FleetTopics, engine: Engine, trail: Trail) -> None:
        self._mqtt = mqtt
        self._engine = engine
        self._trail = trail
        self._tasks: dict[str, asyncio.Task[None]] = {}
        """By topic; the broker's access list limits who may begin such a stop."""
        mqtt.subscribe(topics.direct_stops, self._on_message, needed=False)

    async def close(self) -> None:
        """Cancel what has not been taken over; it stays at the broker."""
        await end(*self._tasks.values())

    def _on_message(self, inbound: Inbound) -> None:
        if earlier := self._tasks.pop(inbound.topic, None):
            earlier.cancel()  # this version says more
        if not inbound.payload:
            return
        try:
            stop = DirectStop.model_validate_json(inbound.payload)
        except ValidationError:
            log.warning("stop of the status aggregator is unreadable", topic=inbound.topic)
            return
        task = asyncio.create_task(self._take_over(inbound.topic, stop), name=f"takeover of {stop.name}")
        self._tasks[inbound.topic] = task

    async def _take_over(self, topic: str, stop: DirectStop) -> None:
        await asyncio.sleep(SETTLED_AFTER)
        while True:
            try:
                await self._record(stop)
            except StoreNotReadyError as error:
                log.warning("stop of the status aggregator not taken over", stop=stop.name, reason=str(error))
            except Exception as error:  # noqa: BLE001 - it is reported, and the stop stays at the broker
                report_failure("stop of the status aggregator not taken over", error, stop=stop.name)
            else:
                break
            await asyncio.sleep(STORE_RETRY)
        self._tasks.pop(topic, None)
        self._mqtt.publish(Outbound(topic, b"", retain=True))

    async def _record(self, stop: DirectStop) -> None:
        asked = partial(ChangingRequest, kind="stop", name=stop.name, body=serialiser_of(stop))
        begun = Origin(AuditInterface.REST, stop.user, CLIENT)
        with self._trail.record_request(asked(begun, STOP.name)):
            if not stop.ended:
                async with self._engine.unit_of_work.saved():
                    self._engine.continue_stop(stop)
        if stop.ended:
            ended = Origin(AuditInterface.REST, stop.ended_by_user, CLIENT)
            with self._trail.record_request(asked(ended, END_STOP.name)):
                if late := self._engine.stops.same_as(stop):
                    async with self._engine.unit_of_work.saved():
                        self._engine.end_stop(late.name, stop.ended_by, stop.end_reason)
