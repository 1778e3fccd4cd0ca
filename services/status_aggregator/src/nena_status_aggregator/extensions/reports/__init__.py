"""Reports: figures of robots and orders over a time range of the history."""

from __future__ import annotations

from collections.abc import Iterable

from fastapi import APIRouter

from nena_status_aggregator.extension import Extension
from nena_status_aggregator.extensions.reports.routes import make_router


class Reports(Extension):
    """Serves ``/api/v1/report``."""

    def routers(self) -> Iterable[APIRouter]:
        """Return the routes of reports."""
        return (make_router(self.core.history, self.core.clock),)
