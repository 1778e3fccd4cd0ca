"""The table of operations defines openTCS's routes for them."""

from __future__ import annotations

from golden.outside import opentcs, order_service
from nena_shared.fleet_api.operations import OPERATIONS


def test_the_aliases_of_the_table_are_served() -> None:
    paths = opentcs(order_service()).openapi()["paths"]
    served = {f"{method.upper()} {path}" for path, methods in paths.items() for method in methods}
    aliases = [alias.replace(":path}", "}") for each in OPERATIONS for alias in each.opentcs]
    assert len(aliases) == len(set(aliases))
    assert served >= set(aliases)
