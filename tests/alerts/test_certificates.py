"""A certificate of a program comes near its end."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from alerts.watched import WatchedSite, watched
from faults.site import Layout
from support.broker import Broker, free_port
from support.certificates import Authority
from support.programs import Program

pytestmark = [pytest.mark.e2e, pytest.mark.broker, pytest.mark.long, pytest.mark.timeout(600)]

LIFETIME, LEFT = 100, 7
"""Days; the alert fires 14 days before the end."""
SHORT_LIFETIME = 7
"""Days of a certificate that is renewed often."""


class EncryptedSite(WatchedSite):
    """A site whose aggregator reaches the broker by TLS, with a certificate."""

    def __init__(self, folder: Path, layout: Layout) -> None:
        """Prepare it, with certificates in ``folder``."""
        self.authority = Authority(folder)
        self._tls_port = free_port()
        self.renew(SHORT_LIFETIME)
        super().__init__(folder, layout)

    def renew(self, days: int, *, age: int = 0) -> None:
        """Issue the aggregator's certificate again, for so many days."""
        self._client = self.authority.sign("aggregator", days=days, age=age)

    def start_aggregator(self) -> Program:
        """Start the status aggregator with its certificate."""
        return self._program(
            "aggregator",
            "nena-status-aggregator",
            *("--http.port", self._ports["aggregator"], "--http.burst", 100_000, "--history.url", "none"),
            *("--mqtt.port", self._tls_port, "--mqtt.tls.ca", self.authority.ca),
            *("--mqtt.tls.certificate", self._client.certificate, "--mqtt.tls.key", self._client.key),
        )

    def _make_broker(self) -> Broker:
        server = self.authority.sign("broker")
        listener = (
            f"listener {self._tls_port} 127.0.0.1\ncafile {self.authority.ca}\n"
            f"certfile {server.certificate}\nkeyfile {server.key}\nrequire_certificate true\n"
        )
        broker = Broker(more=listener)
        self.stack.callback(broker.close)
        return broker


@asynccontextmanager
async def certificate_near_its_end(site: EncryptedSite) -> AsyncIterator[None]:
    """Leave the aggregator with the last days of a certificate, and renew it at the end, for a week."""
    site.renew(LEFT, age=LIFETIME - LEFT)
    yield
    site.renew(SHORT_LIFETIME)


async def test_certificate_near_its_end(tmp_path: Path) -> None:
    site = EncryptedSite(tmp_path, Layout(loopback=2, singles=1))
    async with watched(site) as watch:
        await watch.finds(
            certificate_near_its_end(site),
            {"NenaCertificateExpires": 1},
            certificate="mqtt",
            job="nena-status-aggregator",
        )
