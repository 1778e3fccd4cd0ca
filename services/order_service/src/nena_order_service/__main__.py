"""The order service as a program: ``nena-order-service``."""

from __future__ import annotations

import sys

import uvloop

from nena_order_service.app import serve
from nena_order_service.extension import installed
from nena_order_service.settings import OrderServiceSettings
from nena_shared.program import run


def main() -> int:
    """Run the order service; return exit status 0 after a signal, 2 for invalid settings, otherwise 1."""
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
