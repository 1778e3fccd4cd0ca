"""Rate limits of clients and of robots."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from nena_shared.log import get_logger
from nena_shared.tasks import report_failure

log = get_logger(__name__)

KEPT = 10_000
"""Maximum stored clients; beyond it, the one idle for longest is removed."""


@dataclass(slots=True)
class _Bucket:
    level: float
    at: float


class RateLimit:
    """Allows each client ``rate`` requests per second, with bursts of ``burst`` requests."""

    def __init__(self, rate: float, burst: int) -> None:
        self._rate = rate
        self._burst = burst
        self._buckets: OrderedDict[str, _Bucket] = OrderedDict()

    def wait(self, asker: str, now: float, *, cost: float = 1.0) -> float:
        """Count a request; return the seconds that the client has to wait, 0 if it may continue.

        Rejected requests cost nothing; a ``cost`` of 0 only checks. ``now``: monotonic clock, s.
        """
        bucket = self._buckets.setdefault(asker, _Bucket(self._burst, now))
        self._buckets.move_to_end(asker)
        # clients choose their addresses and topics, so their number has no limit of its own
        if len(self._buckets) > KEPT:
            self._buckets.popitem(last=False)
        bucket.level = min(self._burst, bucket.level + (now - bucket.at) * self._rate)
        bucket.at = now
        if bucket.level < 1.0:
            return (1.0 - bucket.level) / self._rate
        # below 0 after a long message: its topic waits for longer then
        bucket.level -= cost
        return 0.0


# 0050: a state of 4 MiB takes as long to read as hundreds of usual ones
BYTES_PER_MESSAGE: Final = 10_000
"""A longer message counts as several."""


POSTPONED: Final = 1000
"""Maximum number of topics with a postponed message."""


class MessageRate:
    """Limits the messages on each topic, so that a faulty robot cannot occupy a program.

    A program drops messages beyond the limit before it reads them, except for the last one of a topic: it is
    read once the limit allows, because no other may follow a last will or a factsheet.
    """

    def __init__(self, rate: float, burst: int) -> None:
        # 0050: by topic, not by robot, so that a flood of states hides no last will and no factsheet
        self._limit = RateLimit(rate, burst)
        self._logged = RateLimit(rate=1 / 60, burst=1)
        self._postponed: dict[str, Callable[[], None]] = {}

    def exceeded(self, topic: str, size: int, now: float, *, read: Callable[[], None]) -> bool:
        """Count a message of ``size`` bytes; return whether to drop it. ``now``: monotonic clock, s.

        :meth:`read_postponed` may call ``read`` later, unless the message has more than
        :data:`BYTES_PER_MESSAGE` bytes.
        """
        # the new message replaces it, whether it is read now or postponed
        self._postponed.pop(topic, None)
        if not self._limit.wait(topic, now, cost=max(1.0, size / BYTES_PER_MESSAGE)):
            return False
        if size <= BYTES_PER_MESSAGE and len(self._postponed) < POSTPONED:
            self._postponed[topic] = read
        if not self._logged.wait(topic, now):
            log.warning("dropping messages: a robot sends too many or too long ones", topic=topic)
        return True

    def read_postponed(self, now: float) -> None:
        """Read the postponed messages that the limit allows by now; call this periodically.

        A failure is logged, as that of a handler in the MQTT link: it must not end the caller's task.
        """
        for topic in [each for each in self._postponed if not self._limit.wait(each, now, cost=0)]:
            try:
                self._postponed.pop(topic)()
            except Exception as error:  # noqa: BLE001 - it is reported
                report_failure("reading a postponed message failed", error, topic=topic)
