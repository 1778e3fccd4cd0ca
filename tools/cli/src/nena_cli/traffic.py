"""``nena traffic``: the plan of the next minute."""

from __future__ import annotations

from nena_cli import tables
from nena_cli.service import Service, of_service
from nena_shared.fleet_api.operations.fleet import SHOW_TRAFFIC_PLAN


@of_service
def traffic(service: Service) -> None:
    """Show where vehicles will be in the next minute, what they hold, and which they wait for and why."""
    plan = service.call(SHOW_TRAFFIC_PLAN)
    service.print_one(plan, tables.traffic_table(plan))
