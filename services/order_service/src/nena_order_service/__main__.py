"""The order service as a program: ``nena-order-service``."""

from __future__ import annotations

import gc
import sys

from nena_order_service.app import serve
from nena_order_service.settings import OrderServiceSettings
from nena_shared.program import run

COLLECTED_EACH = 10_000
"""Objects more after which the garbage collector looks again. An order makes thousands that nothing but their
count has to find; at the usual 700 that took a seventh of an order's CPU."""


def main() -> int:
    """Run the order service; the exit status is 0 after a signal, 2 for wrong settings, else 1."""
    gc.set_threshold(COLLECTED_EACH)
    return run(
        OrderServiceSettings,
        serve,
        program="nena-order-service",
        description="Execute transport orders from REST and MQTT on VDA 5050 robots.",
    )


if __name__ == "__main__":
    sys.exit(main())
