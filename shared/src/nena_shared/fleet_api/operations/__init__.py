"""The operations of the order service for hosts, each defined once in the module of its noun.

REST routes, MQTT commands, OpenAPI and AsyncAPI documents, roles, and the client of the ``nena`` command are
generated from this table. A new operation needs an entry in its noun's module, and what executes it in the
file of the same noun in ``nena_order_service.api``; see ``docs/architecture.md``.

All are here, too, imported when one is used first. A command that needs few imports them from their noun's
module, which is faster.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from nena_shared.fleet_api.operations.table import *  # noqa: F403
else:

    def __getattr__(name: str) -> Any:  # noqa: ANN401 - the table contains the types
        """Return an object of the table, from the second time on without this function."""
        entry = globals()[name] = getattr(import_module("nena_shared.fleet_api.operations.table"), name)
        return entry
