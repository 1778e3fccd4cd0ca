"""How much hosts may ask over MQTT: each so often, and all of them so much at a time."""

from __future__ import annotations

from http import HTTPStatus

from nena_order_service.settings import HostSettings
from nena_shared.clock import Clock
from nena_shared.fleet_api.transport_order import Problem
from nena_shared.web.access import RateLimit

REQUESTS_LIMIT = 1000
"""Requests that may be in work at the same time; one more is answered with 503."""


class MqttLimits:
    """Counts what each host asks, orders and commands together, as REST counts what each user asks.

    A host is who its topic says; that nobody takes another one's name is up to the broker's access list.
    """

    def __init__(self, settings: HostSettings, clock: Clock) -> None:
        self._requests = RateLimit(settings.requests_per_second, settings.burst)
        self._clock = clock

    def refusal(self, host: str, in_work: int) -> Problem | None:
        """Count a request; give why it is not taken up while so many are ``in_work``, or None: it is."""
        if seconds := self._requests.wait(host, self._clock.monotonic()):
            detail = f"Too many requests. Ask again in {seconds:.1f} s."
            return _too_many(HTTPStatus.TOO_MANY_REQUESTS, detail)
        if in_work >= REQUESTS_LIMIT:
            detail = f"{REQUESTS_LIMIT} requests are in work already. Send again when they are answered."
            return _too_many(HTTPStatus.SERVICE_UNAVAILABLE, detail)
        return None


def _too_many(status: HTTPStatus, detail: str) -> Problem:
    return Problem(title="Too many requests", status=status, detail=detail)
