"""The order service as a program: ``nena-order-service``."""

from __future__ import annotations

import gc

gc.disable()  # nothing that modules create is garbage: the search for it took a quarter of their loading time

import sys

from nena_order_service.app import serve
from nena_order_service.settings import OrderServiceSettings
from nena_shared.program import run

gc.freeze()
gc.enable()

COLLECTED_EACH = 10_000
"""Threshold of the garbage collector. An order creates thousands of objects that reference counting frees;
with the default of 700, the collector took a seventh of the CPU time of an order."""


def main() -> int:
    """Run the order service; return exit status 0 after a signal, 2 for invalid settings, otherwise 1."""
    gc.set_threshold(COLLECTED_EACH)
    return run(
        OrderServiceSettings,
        serve,
        program="nena-order-service",
        description="Execute transport orders from REST and MQTT on VDA 5050 robots.",
    )


if __name__ == "__main__":
    sys.exit(main())
