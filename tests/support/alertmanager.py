"""A real Alertmanager, and the web hook to which it sends every alert."""

from __future__ import annotations

import json
import subprocess
import threading
import time
from collections import Counter
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Self

import httpx

from support.broker import free_port
from support.prometheus import END_WITHIN, program
from support.waiting import PATIENCE, wait_until

CONFIGURATION = """
route:
  receiver: test
  group_by: ["..."]
  group_wait: 0s
  group_interval: 1s
  repeat_interval: 1h
receivers:
  - name: test
    webhook_configs:
      - url: http://127.0.0.1:{port}/
"""
"""Each alert is sent alone, immediately, and once."""

Labels = frozenset[tuple[str, str]]


@dataclass(frozen=True, slots=True)
class Notice:
    """An alert that was sent to a person."""

    labels: Labels
    firing: bool
    """Whether it began; otherwise it ended."""
    at: float
    """Monotonic time, seconds."""
    link: str = ""
    """Address of its section of the runbook."""

    @property
    def name(self) -> str:
        """Return the name of the alert."""
        return dict(self.labels)["alertname"]


class Receiver:
    """The web hook. Collects what it receives, in a thread of its own."""

    def __init__(self) -> None:
        self.notices: list[Notice] = []
        receiver = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
                receiver.notices += [
                    Notice(
                        frozenset(each["labels"].items()),
                        each["status"] == "firing",
                        time.monotonic(),
                        each["annotations"]["runbook_url"],
                    )
                    for each in body["alerts"]
                ]
                self.send_response(200)
                self.end_headers()

            def log_message(self, *_: object) -> None:
                pass

        self._server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.port = self._server.server_port
        self._thread = threading.Thread(target=self._server.serve_forever, name="web hook")
        self._thread.start()

    def firing(self) -> Counter[str]:
        """Return the names of the alerts that have begun and not ended, with their numbers."""
        last = {each.labels: each for each in self.notices}
        return Counter(each.name for each in last.values() if each.firing)

    def close(self) -> None:
        """End it."""
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()


class Alertmanager:
    """The program, with a receiver."""

    def __init__(self, folder: Path) -> None:
        """Start it with its files in ``folder``."""
        self.receiver = Receiver()
        self.address = f"127.0.0.1:{free_port()}"
        file = folder / "alertmanager.yml"
        file.write_text(CONFIGURATION.format(port=self.receiver.port), encoding="utf-8")
        self._log = folder / "alertmanager.log"
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                [
                    program("prometheus-alertmanager"),
                    f"--config.file={file}",
                    f"--storage.path={folder / 'alertmanager'}",
                    f"--web.listen-address={self.address}",
                    "--cluster.listen-address=",
                ],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )

    def __enter__(self) -> Self:
        wait_until(self._ready, what="Alertmanager")
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait(END_WITHIN)
        self.receiver.close()

    def _ready(self) -> bool:
        assert self._process.poll() is None, self._log.read_text(encoding="utf-8")
        try:
            return httpx.get(f"http://{self.address}/-/ready", timeout=PATIENCE).is_success
        except httpx.TransportError:
            return False
