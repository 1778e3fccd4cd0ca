"""What is done for hosts, the same through all doors."""

from __future__ import annotations

from dataclasses import dataclass

from nena_order_service.kernel.host_requests import HostRequests
from nena_order_service.kernel.path_locks import PathLocks
from nena_order_service.kernel.sequence_requests import SequenceRequests
from nena_order_service.kernel.zone_sets import ZoneSets


@dataclass(frozen=True, slots=True)
class HostServices:
    """Each does one kind of what hosts ask for."""

    requests: HostRequests
    sequences: SequenceRequests
    locks: PathLocks
    zones: ZoneSets

    async def load(self) -> None:
        """Take up what hosts have put into the store."""
        await self.locks.load()
        await self.zones.load()
