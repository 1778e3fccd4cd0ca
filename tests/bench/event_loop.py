"""How long an event loop is held, seen from outside: the time to answer /healthz, every 20 ms.

Run in a separate process: ``bench.event_loop URL``; for each line of its input it prints the answer times
since the last one (s) as JSON, and exits when its input closes.
"""

from __future__ import annotations

import http.client
import json
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from urllib.parse import urlsplit

import httpx

from bench.figures import milliseconds
from bench.helper import helper
from support.pausing import pass_time

EVERY = 0.02
TIMEOUT = 300.0
AT_REST_SECONDS = 3.0
LONGEST_HOLD_MS = 50.0
"""Target."""


class LoopProbe:
    """The process as the benchmark sees it."""

    def __init__(self, process: subprocess.Popen[str], url: str) -> None:
        self._process = process
        self._url = url
        pass_time(AT_REST_SECONDS)
        self._at_rest = self._samples()

    def figures(self) -> dict[str, Any]:
        """Return the answer times at rest and since then, and what the program itself measured.

        ``own_longest_ms`` covers the last minute, see :mod:`nena_shared.loop_lag`; None: it exports none.
        """
        loaded = milliseconds(self._samples())
        at_rest = milliseconds(self._at_rest)
        own = httpx.get(f"{self._url}/readyz", timeout=TIMEOUT).json().get("loopLag")
        return {
            "healthz": loaded,
            "healthz_at_rest": at_rest,
            "ratio_p50": round(loaded["p50_ms"] / at_rest["p50_ms"], 2),
            "own_longest_ms": None if own is None else round(own * 1e3, 1),
            "longest_ms": loaded["max_ms"],
        }

    def _samples(self) -> list[float]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        found: list[float] = json.loads(self._process.stdout.readline())
        return found


@contextmanager
def loop_probe(url: str) -> Iterator[LoopProbe]:
    """Run it until the block ends; begins with :data:`AT_REST_SECONDS` at rest."""
    with helper("bench.event_loop", url) as process:
        yield LoopProbe(process, url)


def main() -> None:
    """Ask until the input closes."""
    address = urlsplit(sys.argv[1])
    samples: list[float] = []
    ended = threading.Event()

    def ask() -> None:
        connection = http.client.HTTPConnection(address.hostname or "", address.port, timeout=TIMEOUT)
        while not ended.wait(EVERY):
            begin = time.perf_counter()
            connection.request("GET", "/healthz")
            connection.getresponse().read()
            samples.append(time.perf_counter() - begin)

    asking = threading.Thread(target=ask, name="ask", daemon=True)
    asking.start()
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    for _ in sys.stdin:
        found, samples[:] = samples[:], []
        sys.stdout.write(json.dumps(found) + "\n")
        sys.stdout.flush()
    ended.set()


if __name__ == "__main__":
    main()
