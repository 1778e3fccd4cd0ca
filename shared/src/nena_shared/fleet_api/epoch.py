"""The epoch in retained statuses: which of several order services that share a store published them.

Each takeover by a standby begins a new epoch. What an order service of an older epoch published, or still
publishes, is outdated.
"""

from __future__ import annotations

from pydantic import ValidationError

from nena_shared.fleet_api.base import Resource
from nena_shared.log import get_logger

log = get_logger(__name__)


class _Stamp(Resource):
    epoch: int = 0


def with_epoch(body: bytes, epoch: int) -> bytes:
    """Return the JSON object ``body``, which must not be empty, with one more field: ``epoch``."""
    return b'%s,"epoch":%d}' % (body[:-1], epoch)


def epoch_of(body: bytes) -> int:
    """Return the epoch of a status; 0 where it has none or cannot be read."""
    try:
        return _Stamp.model_validate_json(body).epoch
    except ValidationError:
        return 0


class EpochFilter:
    """Recognises statuses of an order service that another one has replaced."""

    def __init__(self) -> None:
        self._newest = 0
        self.ignored = 0
        """How many statuses were of an older epoch."""

    def is_current(self, body: bytes) -> bool:
        """Return whether ``body`` is of the newest epoch so far; an empty one, which clears, always is."""
        if not body:
            return True
        epoch = epoch_of(body)
        if epoch >= self._newest:
            self._newest = epoch
            return True
        if self.ignored == 0:
            log.warning("ignoring statuses of an older epoch", epoch=epoch, newest=self._newest)
        self.ignored += 1
        return False

    def reset(self) -> None:
        """Forget the newest epoch: after a restore from a backup it may be lower than before."""
        self._newest = 0
