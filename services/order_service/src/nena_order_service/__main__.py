"""The order service as a program: ``nena-order-service``."""

from __future__ import annotations

import sys

from nena_order_service.app import serve
from nena_order_service.settings import OrderServiceSettings
from nena_shared.program import run


def main() -> int:
    """Run the order service; the exit status is 0 after a signal, 2 for wrong settings, else 1."""
    return run(
        OrderServiceSettings,
        serve,
        program="nena-order-service",
        description="Takes transport orders over REST and MQTT and has VDA 5050 robots do them.",
    )


if __name__ == "__main__":
    sys.exit(main())
