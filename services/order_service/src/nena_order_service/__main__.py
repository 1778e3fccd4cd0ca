"""The order service as a program: ``nena-order-service``."""

from __future__ import annotations

import gc
import sys

import uvloop

from nena_order_service.app import serve
from nena_order_service.extension import installed
from nena_order_service.settings import OrderServiceSettings
from nena_shared.program import run

GC_THRESHOLDS = (1_500, 10, 100)
"""An order creates thousands of objects that reference counting frees: with the default of 700, 10 and 10,
the garbage collector took 1.1 of 15.5 s of CPU (profile), and held the event loop for 50 ms at a time."""


def main() -> int:
    """Run the order service; return exit status 0 after a signal, 2 for invalid settings, otherwise 1."""
    gc.set_threshold(*GC_THRESHOLDS)
    return run(
        OrderServiceSettings,
        serve,
        program="nena-order-service",
        description="Execute transport orders from REST and MQTT on VDA 5050 robots.",
        loop_factory=uvloop.new_event_loop,
        extensions=installed,
    )


if __name__ == "__main__":
    sys.exit(main())
