"""The order service as a program: ``nena-order-service``."""

from __future__ import annotations

import gc

gc.disable()  # nothing that modules create is garbage: the search for it took a quarter of their loading time

import sys

import uvloop

from nena_order_service.app import serve
from nena_order_service.settings import OrderServiceSettings
from nena_shared.program import run

gc.freeze()
gc.enable()

GC_THRESHOLDS = (1_500, 10, 100)
"""An order creates thousands of objects that reference counting frees; with the default of 700, the garbage
collector took a seventh of the CPU time of an order. With 10,000, it held the event loop for up to 130 ms at
a time: it counts new objects less freed ones, and many of these are old, so it searched many more."""


def main() -> int:
    """Run the order service; return exit status 0 after a signal, 2 for invalid settings, otherwise 1."""
    gc.set_threshold(*GC_THRESHOLDS)
    return run(
        OrderServiceSettings,
        serve,
        program="nena-order-service",
        description="Execute transport orders from REST and MQTT on VDA 5050 robots.",
        loop_factory=uvloop.new_event_loop,
    )


if __name__ == "__main__":
    sys.exit(main())
