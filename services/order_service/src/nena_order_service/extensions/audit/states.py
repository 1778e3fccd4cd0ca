"""States of objects in the audit trail, in a few words: before a request, and after its change."""

from __future__ import annotations

import json
from contextlib import suppress
from typing import Any

from nena_order_service.api.audit import DescribeObject
from nena_order_service.engine.engine import Engine
from nena_order_service.engine.state import PERIPHERAL_JOB
from nena_order_service.engine.stops import STOP
from nena_order_service.engine.zone_sets import KIND as ZONE_SET
from nena_order_service.engine.zone_sets import WantedZoneSet, ZoneSets
from nena_order_service.errors import UnknownError
from nena_order_service.store.database import Changes
from nena_shared.log import get_logger

log = get_logger(__name__)

State = dict[str, Any]


class ObjectStates:
    """Describes objects in memory; ``changes`` are those of a request, which are not committed yet."""

    def __init__(self, engine: Engine, zones: ZoneSets) -> None:
        self._engine = engine
        self._zones = zones
        self._state = engine.state
        self._kinds: dict[str, DescribeObject] = {
            "transportOrder": self._order_state,
            "orderSequence": self._sequence_state,
            "vehicle": self._vehicle_state,
            "path": self._path_state,
            "stop": self._stop_state,
            "peripheralJob": self._job_state,
            "zoneSet": self._zone_set,
            "plantModel": self._plant_model,
        }

    def describe_object(
        self, kind: str, name: str, changes: Changes | None = None, describe: DescribeObject | None = None
    ) -> str:
        """Return the state of an object as JSON, by ``describe`` if given; empty if it is unknown."""
        describe = describe or self._kinds.get(kind)
        try:
            state = describe(name, changes or Changes()) if describe else None
        except Exception:  # an object that cannot be described must not hold up the change
            log.exception("state not shown in the audit trail", kind=kind, name=name)
            state = None
        return json.dumps(state, ensure_ascii=False) if state else ""

    def _order_state(self, name: str, _: Changes) -> State | None:
        order = self._state.orders.named(name)
        if order is None:
            return None
        status = order.status
        held = {"heldBy": status.held.by} if status.held else {}
        return {"state": order.state.value, "vehicle": status.processing_vehicle, **held}

    def _sequence_state(self, name: str, _: Changes) -> State | None:
        sequence = self._state.sequences.named(name)
        if sequence is None:
            return None
        return {"complete": sequence.status.complete, "finished": sequence.status.finished}

    def _vehicle_state(self, name: str, _: Changes) -> State | None:
        vehicle = self._engine.registry.named(name)
        if vehicle is None:
            return None
        record = self._state.vehicles.of(vehicle.key)
        types = record.acceptable_order_types
        own = {"acceptableOrderTypes": [order_type.name for order_type in types]} if types is not None else {}
        return {"integrationLevel": record.integration_level.value, **own}

    def _path_state(self, name: str, changes: Changes) -> State | None:
        if name in changes.path_locks:
            return {"locked": changes.path_locks[name]}
        is_path = name in self._engine.plant.paths_by_name
        return {"locked": self._engine.context.finder.is_locked(name)} if is_path else None

    def _stop_state(self, name: str, _: Changes) -> State | None:
        with suppress(UnknownError):
            return {"active": bool(self._engine.stops.get(name))}
        return {"active": False} if name else None

    def _job_state(self, name: str, _: Changes) -> State | None:
        job = self._state.peripheral_jobs.named(name)
        return {"state": job.status.state.value} if job else None

    def _zone_set(self, name: str, changes: Changes) -> State | None:
        with suppress(UnknownError):
            document = changes.documents.get((ZONE_SET, name))
            zone_set = WantedZoneSet.model_validate_json(document) if document else self._zones.get(name)
            return {"enabled": zone_set.enabled, "deleted": zone_set.deleted}
        return None

    def _plant_model(self, _name: str, changes: Changes) -> State | None:
        plant = self._engine.plant
        return (
            None if changes else {"name": plant.name, "points": len(plant.points), "paths": len(plant.paths)}
        )


def created_in(changes: Changes, kind: str) -> str:
    """Return the name of the object of this kind that changes create; empty if they create none."""
    if kind == "transportOrder":
        orders = (change.order for change in changes.orders.values() if change.new)
        return next((order.name for order in orders if not order.status.automatic), "")
    if kind == "orderSequence":
        return next((sequence.name for sequence in changes.sequences.values()), "")
    documents = {"stop": STOP, "peripheralJob": PERIPHERAL_JOB}
    of_kind = (
        name
        for (document_kind, name), document in changes.documents.items()
        if document_kind == documents.get(kind) and document
    )
    return next(of_kind, "")
