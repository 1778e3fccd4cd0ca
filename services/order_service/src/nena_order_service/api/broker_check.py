"""Check at each connect what the broker lacks, and make up for it."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from itertools import islice
from typing import Final

from nena_shared.log import get_logger
from nena_shared.mqtt import MqttLink, Outbound
from nena_shared.mqtt.broker_check import LACKS, BrokerLack, UntestableError, find_lacks
from nena_shared.mqtt.client import MqttError
from nena_shared.settings import MqttSettings

log = get_logger(__name__)

POLL: Final = 0.25
"""Seconds between two checks for a new connection."""

REPEAT_EVERY: Final = 15.0
"""Seconds between two repetitions of all statuses."""

REPEATED_AT_ONCE: Final = 50
"""Maximum number of statuses that are repeated every :data:`POLL`."""


class BrokerCheck:
    """Knows what the broker lacks; repeats all statuses at one that delivers them to no new subscriber."""

    def __init__(
        self,
        mqtt: MqttLink,
        settings: MqttSettings,
        *,
        client_id: str,
        prefix: str,
        signs: str,
        statuses: Callable[[], Iterator[Outbound]],
    ) -> None:
        """``signs`` are those in names of robots that some brokers refuse or change."""
        self._mqtt = mqtt
        self._settings = settings
        self._client_id = f"{client_id}-check"
        self._place = f"{prefix}/brokerCheck/{client_id}"
        self._signs = signs
        self._statuses = statuses
        self.lacks: tuple[BrokerLack, ...] = ()

    async def run(self) -> None:
        """Check after each connect, until cancelled."""
        checked, due, loop = 0, 0.0, asyncio.get_running_loop()
        statuses: Iterator[Outbound] = iter(())
        while True:
            if self._mqtt.state.connected and self._mqtt.state.connects != checked:
                checked = self._mqtt.state.connects
                await self._check()
            if BrokerLack.RETAINED in self.lacks and loop.time() >= due:
                due, statuses = loop.time() + REPEAT_EVERY, self._statuses()
            for message in islice(statuses, REPEATED_AT_ONCE):
                self._mqtt.publish(message)
            await asyncio.sleep(POLL)

    async def _check(self) -> None:
        try:
            lacks = await find_lacks(self._settings, self._client_id, self._place, self._signs)
        except (UntestableError, MqttError, OSError) as error:
            log.info("could not check what the broker lacks", topic=self._place, reason=str(error))
            return
        for lack in lacks:
            if lack not in self.lacks:
                log.warning("the broker lacks something", problem=LACKS[lack])
        self.lacks = lacks
