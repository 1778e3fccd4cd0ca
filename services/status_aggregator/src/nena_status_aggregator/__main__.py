"""The program ``nena-status-aggregator``: start-up, tasks and shutdown."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Sequence

import uvloop

from nena_shared.clock import SystemClock
from nena_shared.program import run
from nena_shared.tasks import Supervisor, forever
from nena_shared.web.server import SHUTDOWN_TIMEOUT, HttpServer
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.app import make_app
from nena_status_aggregator.extension import installed
from nena_status_aggregator.settings import AggregatorSettings


async def serve(settings: AggregatorSettings, stop: asyncio.Event) -> None:
    """Run the aggregator until ``stop`` is set.

    Raises:
        ConfigurationError: public address without protection, or a certificate or users file is unusable.
        StartError: the port is in use, or the history database is unusable.
        TaskFailedError: a task failed.
    """
    aggregator = Aggregator(settings, SystemClock(), installed())
    server = HttpServer(make_app(aggregator, settings.http, settings.order_service), settings.http)
    if aggregator.history:
        await aggregator.history.writer.open()
    async with Supervisor() as tasks:
        if aggregator.history:
            tasks.start("history", aggregator.history.writer.run())
        http = tasks.start("http", server.run())
        tasks.start("mqtt link", aggregator.link.run())
        tasks.start("publish changes", aggregator.keep_publishing())
        for extension in aggregator.extensions:
            for name, work in extension.tasks().items():
                tasks.start(name, forever(name, work), vital=False)
        tasks.start("loop lag", aggregator.loop_lag.run())
        try:
            await tasks.wait(stop)
        finally:
            aggregator.events.close()
            server.stop()
            await asyncio.wait([http], timeout=SHUTDOWN_TIMEOUT + 1)


def main(argv: Sequence[str] | None = None) -> int:
    """Run until a signal stops the program; return the exit status."""
    return run(
        AggregatorSettings,
        serve,
        program="nena-status-aggregator",
        description="Monitor VDA 5050 robots and NeNa's transport orders over MQTT. Serves the control "
        "panel, a REST API, an event stream and Prometheus metrics.",
        argv=argv,
        loop_factory=uvloop.new_event_loop,
        extensions=installed,
    )


if __name__ == "__main__":
    sys.exit(main())
