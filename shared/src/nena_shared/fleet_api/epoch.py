"""The epoch in retained statuses, which identifies the publisher among order services that share a store.

Each takeover by a standby starts a new epoch. Statuses of older epochs are outdated, even if they are
published later.
"""

from __future__ import annotations

from pydantic import ValidationError

from nena_shared.fleet_api.base import Resource
from nena_shared.log import get_logger

log = get_logger(__name__)


class _Stamp(Resource):
    epoch: int = 0


def with_epoch(body: bytes, epoch: int) -> bytes:
    """Add the field ``epoch`` to a non-empty JSON object."""
    # added as text: a status is encoded once, whoever publishes it
    return b'%s,"epoch":%d}' % (body[:-1], epoch)


def epoch_of(body: bytes) -> int:
    """Return the epoch of a status; 0 if it has none or is unreadable."""
    try:
        return _Stamp.model_validate_json(body).epoch
    except ValidationError:
        return 0


class EpochFilter:
    """Detects statuses of replaced order services."""

    def __init__(self) -> None:
        self._newest = 0
        self.ignored = 0
        """Number of statuses of older epochs."""

    def is_current(self, body: bytes) -> bool:
        """Return whether ``body`` has the newest epoch so far; empty ones, which clear a topic, always do."""
        if not body:
            return True
        epoch = epoch_of(body)
        if epoch >= self._newest:
            self._newest = epoch
            return True
        # once: a replaced service that still runs publishes a status with each change
        if self.ignored == 0:
            log.warning("ignoring statuses of an older epoch", epoch=epoch, newest=self._newest)
        self.ignored += 1
        return False

    def reset(self) -> None:
        """Forget the newest epoch, as it may decrease when a backup is restored."""
        self._newest = 0
