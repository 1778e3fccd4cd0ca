"""Waiting until a service is ready."""

from __future__ import annotations

import httpx

from support.waiting import wait_until

READY_SECONDS = 300.0
LOOK_EVERY = 0.1
"""Seconds."""


def wait_until_ready(url: str) -> None:
    """Block the thread until the service at ``url`` is ready."""

    def ready() -> bool:
        try:
            return httpx.get(f"{url}/readyz").status_code == httpx.codes.OK
        except httpx.TransportError:
            return False

    wait_until(ready, timeout=READY_SECONDS, what=f"{url} is ready", every=LOOK_EVERY)
