"""What a row of the audit trail costs: microseconds of CPU in this process.

``request_us`` is spent in the event loop, ``writer_us`` in the store's writer thread, in addition to the
commit of the order that the request creates. ``PYTHONPATH=tests python -m bench.audit_cost`` measures it.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from time import process_time
from unittest.mock import Mock

import sqlalchemy as sa

from bench.figures import Figures
from nena_order_service.api.audit import ChangingRequest, Origin, Trail, body_of_model, record_current
from nena_order_service.store import database
from nena_order_service.store.audit import AuditChain, AuditRow
from nena_order_service.store.database import Changes
from nena_order_service.store.schema import open_database
from nena_shared.clock import SystemClock
from nena_shared.fleet_api.audit import AuditInterface
from support.order_service import dispatchable_order, request

ROWS = 500
"""Rows of a round."""
ROUNDS = 7


def measure() -> Figures:
    """Measure on SQLite; the least of several rounds."""
    with tempfile.TemporaryDirectory() as folder:
        engine = open_database(f"sqlite:///{folder}/orders.db")
        writer = _Writer(engine)
        plain = min(_seconds(lambda: writer.commit([])) for _ in range(ROUNDS))
        recorded = min(_seconds(lambda: writer.commit(_recorded())) for _ in range(ROUNDS))
        engine.dispose()
    in_loop = min(_seconds(_recorded) for _ in range(ROUNDS))
    return {
        "commit_us": plain * 1e6,
        "request_us": in_loop * 1e6,
        "writer_us": (recorded - plain - in_loop) * 1e6,
    }


class _Writer:
    """Commits orders one by one."""

    def __init__(self, engine: sa.Engine) -> None:
        self._engine = engine
        self._chain = AuditChain()
        self._number = 0

    def commit(self, rows: list[AuditRow]) -> None:
        self._number += 1
        changes = Changes(audit=rows)
        changes.put_order(dispatchable_order(number=self._number), None)
        database.write(self._engine, changes, chain=self._chain)


STATES = Mock(of=lambda *_: '{"state": "DISPATCHABLE", "vehicle": null}')
TRAIL = Trail(Mock(), SystemClock(), STATES, kept_days=90)
REQUEST = request("Storage:Unload cargo", "Packing:Load cargo", name="T-1", priority=3)


def _recorded() -> list[AuditRow]:
    """Record a request as its handler and the unit of work do; return the rows."""
    changes = Changes(documents={("a", "b"): None})
    origin = Origin(AuditInterface.REST, "ann", "nena")
    asked = ChangingRequest(origin, "withdraw", "transportOrder", "T-1", body_of_model(REQUEST))
    with TRAIL.recorded(asked):
        record_current(changes)
    return changes.audit


def _seconds(work: Callable[[], object]) -> float:
    began = process_time()
    for _ in range(ROWS):
        work()
    return (process_time() - began) / ROWS


if __name__ == "__main__":
    import json
    import sys

    sys.stdout.write(json.dumps({name: round(value, 1) for name, value in measure().items()}) + "\n")
