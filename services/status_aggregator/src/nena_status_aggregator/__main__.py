"""The program: ``nena-status-aggregator``."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from nena_shared.program import run
from nena_status_aggregator.service import serve
from nena_status_aggregator.settings import AggregatorSettings


def main(argv: Sequence[str] | None = None) -> int:
    """Run until a signal ends it; give the exit status."""
    return run(
        AggregatorSettings,
        serve,
        program="nena-status-aggregator",
        description="Watches a fleet over MQTT: VDA 5050 robots and NeNa's order service. Shows it on a "
        "page, over REST, as a stream of events and as metrics for Prometheus.",
        argv=argv,
    )


if __name__ == "__main__":
    sys.exit(main())
