"""The yardstick of CPU per state: bare paho that parses the JSON of each state.

Run in a separate process: ``bench.bare_subscriber PORT``; prints for each line of its input how many states
have arrived, and exits when its input closes.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from bench.helper import helper
from bench.wire import Wire

STATES = "uagv/v2/+/+/state"


class BareSubscriber:
    """The process as the benchmark sees it."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self.pid = process.pid

    def count(self) -> int:
        """Return how many states it has parsed."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()
        return int(self._process.stdout.readline())


@contextmanager
def bare_subscriber(port: int) -> Iterator[BareSubscriber]:
    """Run it until the block ends; it is subscribed when the block begins."""
    with helper("bench.bare_subscriber", str(port)) as process:
        yield BareSubscriber(process)


def main() -> None:
    """Parse until the input closes."""
    count = 0

    def parse(_topic: str, payload: bytes, _moment: float) -> None:
        nonlocal count
        json.loads(payload)
        count += 1

    wire = Wire(int(sys.argv[1]), "bench-bare", (STATES,), parse)
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    for _ in sys.stdin:
        sys.stdout.write(f"{count}\n")
        sys.stdout.flush()
    wire.close()


if __name__ == "__main__":
    main()
