"""A guard at the broker: two order services with separate stores must not command the same robots.

The one that leads the fleet keeps a retained record at the broker, which its last will clears. Another one
that finds a record asks whether its owner still answers; if so, it exits before it has sent anything. It may
be restored from a copy of the same store: then the newer epoch leads. Order services that share a store have
their leader from it (``store/leadership.py``).
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from secrets import token_hex

from pydantic import ValidationError

from nena_shared.fleet_api.base import Resource
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, LinkHooks, MqttLink, Outbound, Term
from nena_shared.settings import MqttSettings
from nena_shared.tasks import StartError, end, set_within

log = get_logger(__name__)

ANSWERED_WITHIN = 5.0
"""Seconds within which an active order service answers; otherwise its record is stale."""
CONNECTED_WITHIN = 10.0
"""Timeout for connecting and subscribing, seconds."""
DECIDED_WITHIN = ANSWERED_WITHIN + 5.0
"""Timeout for the decision after that, seconds."""
LOOK = 0.05
"""Seconds between checks of the link to the broker."""


class FleetTakenError(StartError):
    """Another order service is active for the fleet; the message identifies it and says what to do."""

    def __init__(self, record: LeaderRecord, *, own_store: bool) -> None:
        if own_store:
            super().__init__(
                "another order service that uses this store, or a copy of it, was started later and "
                f"is active for this fleet (epoch {record.epoch}), so this one has exited. Start it again "
                "only to replace the other one, or as its standby on the same PostgreSQL"
            )
        else:
            super().__init__(
                f"another order service with another store is active for this fleet (store {record.store}, "
                f"epoch {record.epoch}), so this one has exited. Stop the other one, or let both use one "
                "PostgreSQL, or set another interface_name and topic_prefix here"
            )


class LeaderRecord(Resource):
    """The retained record of the order service that leads a fleet."""

    store: str
    epoch: int
    instance: str
    """ID of this run of the program."""

    @property
    def rank(self) -> tuple[int, str]:
        """The highest rank leads the fleet: robots refuse commands of older epochs."""
        return self.epoch, self.instance


class FleetGuard:
    """Finds out over a connection of its own whether this order service leads the fleet."""

    def __init__(self, mqtt: MqttSettings, topic: str, *, store: str, epoch: int, term: Term) -> None:
        """``topic`` is that of the record, ``store`` identifies the store; for ``term`` see :data:`Term`."""
        self.won = asyncio.Event()
        """Set once this order service leads; before that nothing may be sent to robots."""
        self.epoch = epoch
        self.term = term
        self._own = LeaderRecord(store=store, epoch=epoch, instance=token_hex(8))
        self._topic = topic
        self._question = f"{topic}/question"
        self._asked = asyncio.Event()
        """Set once the broker has been asked for the record."""
        self._asked_at = 0.0
        """Time of the question, by the event loop's clock, seconds."""
        self._holds = False
        """Whether the record at the broker is our own."""
        self._left: LeaderRecord | None = None
        """The record of another order service, while that one may still answer."""
        self._giving_up: asyncio.TimerHandle | None = None
        self._taken: asyncio.Future[LeaderRecord] = asyncio.get_running_loop().create_future()
        """The record of the order service that leads instead."""
        self._link = MqttLink(
            mqtt.model_copy(update={"client_id": None}),
            client_id=f"nena-order-service-leader-{self._own.instance}",
            hooks=LinkHooks(
                will=lambda: Outbound(topic, b"", retain=True),
                on_subscribed=self._ask_leader,
                on_lost=self._forget_connection,
            ),
            term=term,
        )
        self._link.subscribe(topic, self._on_record)
        self._link.subscribe(self._question, self._on_question)

    @property
    def problem(self) -> str:
        """Why it is not decided which order service leads; empty if it is, or needs no longer than usual."""
        link = self._link.state
        if self.won.is_set():
            return ""
        if not link.connected:
            return link.last_error
        if link.refused or asyncio.get_running_loop().time() > self._asked_at + DECIDED_WITHIN:
            return (
                f"the broker does not return our messages on {self._topic} and {self._question}: check that "
                "its access list lets the order service write and read them, and that it keeps topics "
                "as they are (Mosquitto before 2.0.12 does not where its listener has a mount_point)"
            )
        return ""

    async def run(self) -> None:
        """Lead until cancelled; raises FleetTakenError if another order service leads the fleet."""
        linking = asyncio.create_task(self._link.run(), name="link of the fleet guard")
        try:
            await asyncio.wait((linking, self._taken), return_when=asyncio.FIRST_COMPLETED)
            if linking.done():
                linking.result()
            taken = self._taken.result()
            raise FleetTakenError(taken, own_store=taken.store == self._own.store)
        finally:
            holds, self._holds = self._holds, False  # or our own clearing would be answered by the record
            if holds:
                # Brokers discard the last will of a client that disconnects by itself.
                self._link.publish(Outbound(self._topic, b"", retain=True))
                with suppress(asyncio.CancelledError):
                    await self._link.drain(1.0)
            self._forget_connection()
            await end(linking)

    async def decided(self) -> None:
        """Wait until this order service leads, while the broker is reachable and it has its lease.

        Orders must not be accepted earlier, because this order service may still have to exit.
        """
        # In steps: a refused connection or a lost lease sets none of these events.
        for step, seconds in ((self._asked, CONNECTED_WITHIN), (self.won, DECIDED_WITHIN)):
            with suppress(TimeoutError):
                async with asyncio.timeout(seconds):
                    while not (self._link.state.last_error or self.term() is None):
                        if await set_within(step, LOOK):
                            break
            if not step.is_set():
                log.warning("not decided which order service leads the fleet", reason=self.problem)
                return

    def _ask_leader(self) -> None:
        """Publish the question; retained records arrive before it comes back."""
        self._asked.set()
        self._asked_at = asyncio.get_running_loop().time()
        self._link.publish(Outbound(self._question, self._own.instance.encode()))

    def _on_question(self, message: Inbound) -> None:
        if self._holds:
            self._publish_record()
        elif message.payload != self._own.instance.encode():
            return
        # It is our own question: a retained record would have arrived before it.
        elif self._left is None:
            self._hold_back()
        elif self._giving_up is None:
            self._giving_up = asyncio.get_running_loop().call_later(ANSWERED_WITHIN, self._hold_back)

    def _on_record(self, message: Inbound) -> None:
        if not message.payload:
            self._left = None
            if self._holds:
                self._publish_record()  # the last will of another one has cleared it
            elif self._giving_up:
                self._hold_back()
            return
        try:
            record = LeaderRecord.model_validate_json(message.payload)
        except ValidationError:
            log.warning("leader record is unreadable", topic=message.topic)
            return
        if record.instance == self._own.instance:
            return
        own_store, is_higher = record.store == self._own.store, record.rank > self._own.rank
        # Copies of a store differ by their epochs. Another store's leader wins only by having answered first.
        if (own_store or self.won.is_set()) and not is_higher:
            if self._holds:
                self._publish_record()
        elif own_store or not message.retained:
            self._holds = False
            if not self._taken.done():
                self._taken.set_result(record)
        else:
            self._left = record

    def _hold_back(self) -> None:
        if self._left is not None:
            log.warning("previous leader of this fleet does not answer", store=self._left.store)
        self._left, self._giving_up, self._holds = None, None, True
        self._publish_record()
        self.won.set()

    def _publish_record(self) -> None:
        body = self._own.model_dump_json(by_alias=True).encode()
        self._link.publish(Outbound(self._topic, body, retain=True))

    def _forget_connection(self) -> None:
        """Discard what an earlier connection has shown."""
        self._holds, self._left = False, None
        if self._giving_up:
            self._giving_up.cancel()
            self._giving_up = None
