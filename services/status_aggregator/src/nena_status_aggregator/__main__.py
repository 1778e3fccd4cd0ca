"""The program: ``nena-status-aggregator``."""

from __future__ import annotations

import asyncio
import gc
import sys
from collections.abc import Sequence

from nena_shared.clock import SystemClock
from nena_shared.program import run
from nena_shared.tasks import Supervisor
from nena_shared.web.server import SHUTDOWN_TIMEOUT, HttpServer
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.app import make_app
from nena_status_aggregator.settings import AggregatorSettings

GC_THRESHOLDS = (50_000, 20, 100)
"""Messages are trees without cycles, which go without the collector; by Python's own thresholds it would look
through all robots' states after every few messages, for a quarter of the CPU."""


async def serve(settings: AggregatorSettings, stop: asyncio.Event) -> None:
    """Run the aggregator until ``stop`` is set.

    Raises:
        ConfigurationError: the address is not protected, or a file for that cannot be used.
        StartError: the port is not to be had, or the history cannot be kept.
        TaskFailedError: a part of the program has failed.

    """
    gc.set_threshold(*GC_THRESHOLDS)
    aggregator = Aggregator(settings, SystemClock())
    server = HttpServer(make_app(aggregator, settings.http, settings.order_service), settings.http)
    if aggregator.history:
        await aggregator.history.writer.open()
    async with Supervisor() as tasks:
        if aggregator.history:
            tasks.start("history", aggregator.history.writer.run())
        http = tasks.start("http", server.run())
        tasks.start("mqtt link", aggregator.link.run())
        tasks.start("publish changes", aggregator.keep_publishing())
        try:
            await tasks.wait(stop)
        finally:
            aggregator.events.close()
            server.stop()
            await asyncio.wait([http], timeout=SHUTDOWN_TIMEOUT + 1)


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
