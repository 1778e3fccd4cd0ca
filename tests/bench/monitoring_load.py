"""The load of :mod:`bench.monitoring_cost`: robots, a scraper and a collector of traces.

Each line on standard input is an address to scrape, once.
"""

from __future__ import annotations

import os
import sys
import threading
import urllib.request
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from bench.lanes import Hall
from bench.passing_nodes import POINTS, PassingRobots
from bench.rates import Hosts
from nena_demo.processes import Processes


class _Collector(BaseHTTPRequestHandler):
    """Accepts all traces."""

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers["Content-Length"]))
        self.send_response(200)
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


def _scrape_on_request(end: Callable[[], None]) -> None:
    for line in sys.stdin:
        request = urllib.request.Request(line.strip(), headers={"Accept-Encoding": "gzip"})  # noqa: S310
        with urllib.request.urlopen(request) as answer:  # noqa: S310 - our own address
            answer.read()
    end()


def main(broker_port: int, url: str, robots: int, collector_port: int) -> None:
    """Put load on an order service at ``url`` until standard input ends; without robots, only scrape."""
    collector = ThreadingHTTPServer(("127.0.0.1", collector_port), _Collector)
    threading.Thread(target=collector.serve_forever, daemon=True).start()
    ended = threading.Event()
    reader = threading.Thread(target=_scrape_on_request, args=(ended.set,), daemon=True)
    if robots:
        hall = Hall(broker_port, url, os.getpid(), robots, Processes(Path()))
        hosts = Hosts(url)
        fleet = PassingRobots(hall, hosts)
        hall.wait_for_robots()
        for second in range(POINTS):  # so that the orders do not end all at once
            fleet.begin(second, POINTS)
            fleet.drive(1)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    reader.start()
    if not robots:
        ended.wait()
        return
    while not ended.is_set():
        fleet.drive(1)
    hosts.close()
    fleet.close()


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
