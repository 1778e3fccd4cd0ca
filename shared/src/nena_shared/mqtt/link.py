"""A program's link to the broker: connects, subscribes, reconnects, and never blocks the caller."""

from __future__ import annotations

import asyncio
from collections import OrderedDict, deque
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from itertools import count
from time import monotonic
from typing import Final, Protocol

from paho.mqtt.client import topic_matches_sub

from nena_shared.log import get_logger
from nena_shared.mqtt.client import Client, Inbound, MqttError, Outbound
from nena_shared.mqtt.identity import tls_context
from nena_shared.settings import ConfigurationError, MqttSettings
from nena_shared.tasks import end_if_cancelled, report_failure

log = get_logger(__name__)

Handler = Callable[[Inbound], None]
Term = Callable[[], int | None]
"""Returns the number of the current term in which the program may publish; None: it may not."""


def always() -> int | None:
    """Return the only term of a program that may always publish."""
    return 0


SUSPICIOUS: Final = 3
"""Number of consecutive short connections after which a client ID conflict is suspected."""

NAMES_AT_ONCE = 200
"""Maximum number of topics in a subscription by name."""
NAMES_LOGGED = 10
"""Maximum number of refused topics that are logged."""

CONNECT_TIMEOUT = 10.0
"""Timeout of CONNECT and SUBSCRIBE, seconds."""

IN_FLIGHT_LIMIT = 200
"""Maximum number of unacknowledged QoS 1 messages."""

TERM_POLL = 0.25
"""Interval between checks whether the program may still publish, seconds."""

SOON = 5.0
"""Seconds within which a broker ends the connection at a message that it refuses."""

STABLE_AFTER = 1.0
"""Seconds after a connect before a message is sent whose refusal would be concluded from another end."""

SUSPECTED_FOR = 60.0
"""Seconds after a connect within which a message at which the last connection ended is sent again."""

SET_ASIDE_FOR = 600.0
"""Seconds after which a topic that was set aside is tried again: the access list may have been corrected."""

SET_ASIDE_LIMIT = 1000
"""Maximum number of topics that are set aside; beyond, the oldest is tried again."""

DROPS_LOGGED_EVERY = 60.0
"""Minimum interval between log lines about messages dropped from a full queue, seconds."""

ENDS: Final = 2
"""Number of connections that must end at a message, or at a subscription, before it counts as refused."""

SUSPECTS_LIMIT: Final = 1000
"""Maximum number of suspected topics; beyond, the oldest is no longer suspected."""


@dataclass(frozen=True, slots=True)
class LinkHooks:
    """A program's callbacks for changes of its connection."""

    will: Callable[[], Outbound | None] = lambda: None
    """Returns the last will, on each connect; None: no last will."""
    on_connected: Callable[[], Iterable[Outbound]] = tuple
    """Returns the messages to publish before subscribing; called on each connect, so they are not kept after
    a disconnect. Consumed in parts, between which other tasks run."""
    on_lost: Callable[[], None] = lambda: None
    """Called when the connection has ended."""
    on_subscribed: Callable[[], None] = lambda: None
    """Called when the broker has answered the subscriptions; ``state.refused`` lists refused ones."""


NO_HOOKS = LinkHooks()


@dataclass(slots=True)
class LinkState:
    """The state of a link, for health checks and metrics."""

    connected: bool = False
    connects: int = 0
    received: int = 0
    published: int = 0
    dropped: int = 0
    handler_failures: int = 0
    refused: tuple[str, ...] = ()
    """Topic filters of needed subscriptions that the broker refused."""
    set_aside: dict[str, int] = field(default_factory=dict)
    """Topics at whose messages the broker ends the connection, with the number of messages not sent."""
    refused_names: frozenset[str] = frozenset()
    """Topics that the broker refused to subscribe to by name."""
    last_error: str = ""
    term: int = 0
    """The term of the connection, see :data:`Term`."""


class BrokerLink(Protocol):
    """A program's link to the broker, as :class:`MqttLink` and simulations provide it."""

    state: LinkState

    def subscribe(self, topic_filter: str, handler: Handler, *, qos: int = 1, needed: bool = True) -> None:
        """Subscribe to ``topic_filter``; see :meth:`MqttLink.subscribe`."""
        ...

    def subscribe_by_name(self, topic: str) -> None:
        """Also subscribe to ``topic`` by its name; see :meth:`MqttLink.subscribe_by_name`."""
        ...

    def publish(self, message: Outbound) -> None:
        """Send ``message`` if the link is up, or later; see :meth:`MqttLink.publish`."""
        ...

    async def run(self) -> None:
        """Keep the link connected until cancelled."""
        ...

    def cut(self, seconds: float) -> None:
        """Interrupt the connection for ``seconds``."""
        ...

    async def read_waiting(self, seconds: float) -> None:
        """Wait up to ``seconds`` until all messages received so far are read."""
        ...

    async def drain(self, seconds: float) -> bool:
        """Wait up to ``seconds`` until all published messages are acknowledged; return whether they are."""
        ...


class Pauses:
    """Delays between connection attempts, doubling from ``shortest`` to ``longest`` seconds.

    They restart at the shortest after a connection that lasted twice the longest delay. A shorter connection
    counts as a failed attempt, because two programs with one client ID disconnect each other repeatedly.
    """

    def __init__(self, shortest: float, longest: float) -> None:
        self._shortest, self._longest = shortest, longest
        self._next = shortest
        self._short_lived = 0

    @property
    def suspicious(self) -> bool:
        """Whether exactly the last :data:`SUSPICIOUS` connections were too short."""
        return self._short_lived == SUSPICIOUS

    def after(self, stood: float | None) -> float:
        """Return the delay (s) after a connection of ``stood`` s; None: the attempt failed."""
        if stood is not None and stood >= 2 * self._longest:
            self._next, self._short_lived = self._shortest, 0
        elif stood is not None:
            self._short_lived += 1
        pause, self._next = self._next, min(self._next * 2, self._longest)
        return pause


_Key = str | int | tuple[str]
"""A retained topic, the same in a tuple for its clearing message, or the number of any other message."""


class Outbox:
    """A queue with a defined overflow rule.

    - A retained message replaces the queued one of its topic, at the same position. It is never dropped: the
      queue holds at most one status and one clearing message per topic.
    - A message that clears a topic comes after the last status of that topic, so that subscribers still see
      how an order ended.
    - At most ``limit`` other messages are queued; beyond, a new one replaces the oldest.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._waiting: OrderedDict[_Key, Outbound] = OrderedDict()
        self._numbers = count()
        self._droppable: deque[int] = deque()
        """Keys of messages that are not retained, oldest first."""

    def __len__(self) -> int:
        return len(self._waiting)

    def __iter__(self) -> Iterator[Outbound]:
        return iter(self._waiting.values())

    def add(self, message: Outbound) -> Outbound | None:
        """Append a message; return the message dropped for it, if any."""
        if not message.retain:
            return self._add_droppable(message)
        if message.payload:
            # the topic is in use again: its clearing message would remove the new status
            self._waiting.pop((message.topic,), None)
            self._waiting[message.topic] = message
        else:
            self._waiting[message.topic,] = message
        return None

    def pop(self) -> Outbound:
        """Remove and return the oldest message; raises KeyError if the queue is empty."""
        key, message = self._waiting.popitem(last=False)
        if isinstance(key, int):
            self._droppable.popleft()
        return message

    def clear(self) -> None:
        """Remove all messages."""
        self._waiting.clear()
        self._droppable.clear()

    def _add_droppable(self, message: Outbound) -> Outbound | None:
        dropped = None
        if len(self._droppable) >= self._limit:
            dropped = self._waiting.pop(self._droppable.popleft())
        number = next(self._numbers)
        self._waiting[number] = message
        self._droppable.append(number)
        return dropped


class Suspects:
    """Topics whose messages may be the reason why connections have ended.

    A broker that refuses a message either acknowledges it or ends the connection, without a reason (MQTT
    3.1.1 section 3.3.5). Connections end for other reasons as well, so all messages in flight at the end are
    only suspects. On the next connection, the link sends each of them alone, and waits for its
    acknowledgement, which clears it. A message is refused if :data:`ENDS` connections have ended while it was
    alone in flight, the last one after it had stood for a while: a broker that crashes again and again, or a
    cable that is cut, acknowledges it in between.

    Topics stand for messages, because statuses and commands are sent again with other content.
    """

    def __init__(self) -> None:
        self._ends: dict[str, int] = {}
        """By suspected topic, the number of connections that have ended while it was alone in flight."""

    def __len__(self) -> int:
        return len(self._ends)

    def __contains__(self, topic: str) -> bool:
        return topic in self._ends

    def near_refusal(self, topic: str) -> bool:
        """Return whether the next end of a connection at this topic shows that it is refused."""
        return self._ends.get(topic, 0) == ENDS - 1

    def add_refused(self, topic: str) -> None:
        """Suspect a topic that was refused before: one more end of a connection shows that it still is."""
        self._ends[topic] = ENDS - 1

    def clear(self, topic: str) -> None:
        """Remove a topic: the broker has accepted a message on it."""
        self._ends.pop(topic, None)

    def note_end(self, in_flight: Collection[str], *, alone: bool) -> str | None:
        """Suspect the topics in flight at the end of a connection; return the one that is refused, if any.

        It is no longer a suspect then. ``alone``: one message was in flight, with an acknowledgement due.
        """
        for topic in in_flight:
            # taken out and added again, so that the one suspected longest ago stands first
            ends = self._ends.pop(topic, 0) + alone
            if ends >= ENDS:
                return topic
            self._ends[topic] = ends
        while len(self._ends) > SUSPECTS_LIMIT:
            del self._ends[next(iter(self._ends))]
        return None


@dataclass(slots=True, eq=False)
class _Subscription:
    topic_filter: str
    handler: Handler
    qos: int
    needed: bool
    ends: int = 0
    """Number of connections that ended before it was answered, alone or with other optional ones."""


@dataclass(slots=True)
class _Session:
    """State of one connection."""

    client: Client
    first: deque[Outbound] = field(default_factory=deque)
    """Messages to publish first; not kept after a disconnect."""
    deliveries: dict[int, tuple[Outbound, float]] = field(default_factory=dict)
    """Messages not acknowledged by the broker yet, in the order of sending, with its time (monotonic, s)."""
    sent: int = 0
    """Number of messages sent; numbers the messages."""
    unacknowledged: deque[tuple[str, float]] = field(default_factory=lambda: deque(maxlen=IN_FLIGHT_LIMIT))
    """Topics of the last messages with QoS 0, which the broker does not acknowledge, with the same time."""
    alone: int = 0
    """Number of the suspect that is in flight; nothing else is sent meanwhile. 0: none."""
    stable: bool = False
    """Whether the connection has stood for :data:`STABLE_AFTER`."""
    subscribed: set[_Subscription] = field(default_factory=set)
    """The subscriptions sent to the broker."""
    subscribed_by_name: int = 0
    """Number of its topics subscribed to by name, after these."""
    subscribing: asyncio.Task[None] | None = None
    told_of_strays: bool = False
    """Whether a message on a topic that was not subscribed to was logged: some brokers change topics."""

    @property
    def has_room(self) -> bool:
        """Whether another message may be in flight."""
        return len(self.deliveries) < IN_FLIGHT_LIMIT


class MqttLink:
    """Publishes and receives for one program. Not thread-safe: use it in the event loop only.

    Sessions are clean, so that brokers do not queue old commands; the protocols above recover what was missed
    (retained messages, complete states, orders resent until a state echoes them). While the link is down or
    the broker is slow, messages wait in an :class:`Outbox`, which never drops the last retained message of a
    topic, and counts and logs dropped messages. Messages with ``keep=False`` are dropped on a disconnect.

    A broker may end the connection at a message that it refuses; see :class:`Suspects`. The topic of such a
    message is set aside for :data:`SET_ASIDE_FOR`; ``state.set_aside`` counts the messages on it that are not
    sent.

    A program that may only publish in limited terms, such as one of several order services, passes ``term``,
    which is called before each write to the socket. At the end of a term the connection is closed without
    writing, and all waiting messages are dropped. The next connection is made in the next term.
    """

    def __init__(
        self,
        settings: MqttSettings,
        *,
        client_id: str,
        hooks: LinkHooks = NO_HOOKS,
        term: Term = always,
    ) -> None:
        """Create the link; :meth:`run` connects it.

        Args:
            settings: address of the broker, and limits.
            client_id: MQTT client ID unless set in ``settings``; unique at the broker.
            hooks: callbacks for changes of the connection.
            term: returns the term in which the program may currently publish.

        Raises:
            ConfigurationError: the password file or a TLS file cannot be read.
        """
        settings.secret()
        tls_context(settings.tls)
        self._settings = settings
        self._client_id = settings.client_id or client_id
        self._hooks = hooks
        self._term = term
        self._subscriptions: list[_Subscription] = []
        self._names: list[str] = []
        self._ends_at_names = 0
        """Number of connections in a row that have ended at a subscription by name."""
        self._outbox = Outbox(settings.outgoing_limit)
        self._suspects = Suspects()
        self._ended_alone = False
        """Whether the last connection ended while a suspect was alone in flight."""
        self._subscribes_singly = False
        """Whether needed subscriptions are sent one by one, because a connection ended at them."""
        self._drops_to_log = 0
        self._drops_logged_at = -DROPS_LOGGED_EVERY
        self._session: _Session | None = None
        self._connecting = False
        """Whether a session has started, but its subscriptions are not confirmed yet."""
        self._handlers = lru_cache(maxsize=10_000)(self._matching_handlers)
        self._silence = 0.0
        self._connected_at = 0.0
        self._settled = asyncio.Event()
        self.state = LinkState()

    def subscribe(self, topic_filter: str, handler: Handler, *, qos: int = 1, needed: bool = True) -> None:
        """Subscribe to ``topic_filter``, immediately or on the next connect; ``handler`` gets its messages.

        If the broker refuses a filter that is not ``needed``, this is only logged.
        """
        self._subscriptions.append(_Subscription(topic_filter, handler, qos, needed))
        self._handlers.cache_clear()
        if self._session:
            self._subscribe_late(self._session)

    def subscribe_by_name(self, topic: str) -> None:
        """Also subscribe to ``topic`` of a wildcard subscription by its name, now or on the next connect.

        RabbitMQ delivers retained messages only so. Other brokers may then deliver a message once for each
        subscription, and each delivery reaches the handler.
        """
        if topic in self._names:
            return
        self._names.append(topic)
        if self._session:
            self._subscribe_late(self._session)

    def publish(self, message: Outbound) -> None:
        """Send ``message`` now, or if ``keep`` is set, when the link is up again; see :class:`Outbox`."""
        session = self._session
        if self._term() is None:
            self.state.dropped += 1
        elif message.topic in self.state.set_aside:
            self._drop_set_aside(message)
        # only if nothing waits: messages leave in the order in which they were published
        elif session and not session.first and not self._outbox and self._may_send(session, message):
            self._send_message(session, message)
        elif session or message.keep:
            self._queue_message(message)
        else:
            self.state.dropped += 1

    async def run(self) -> None:
        """Keep the link connected until cancelled; reconnect with increasing delays."""
        pauses = Pauses(self._settings.reconnect_min, self._settings.reconnect_max)
        clock = asyncio.get_running_loop().time
        while True:
            connects = self.state.connects
            await self._begin_term()
            try:
                await self._serve_connection()
            # UnicodeError: a host name that IDNA cannot encode; ConfigurationError: TLS files, read each time
            except (MqttError, OSError, UnicodeError, ConfigurationError) as error:
                self._log_failure(error, lost=self.state.connects > connects)
            end_if_cancelled()
            stood = clock() - self._connected_at if self.state.connects > connects else None
            ended_alone, self._ended_alone = self._ended_alone, False
            # the end of a suspect's trial is no failed attempt, and must not delay all other messages
            pause = self._settings.reconnect_min if ended_alone else pauses.after(stood)
            if pauses.suspicious and not ended_alone:
                self._log_suspicion()
            silence, self._silence = self._silence, 0.0
            await asyncio.sleep(max(pause, silence))

    def cut(self, seconds: float) -> None:
        """Interrupt the connection for ``seconds``, as out of radio range; for simulations."""
        if self._session:
            self._silence = seconds
            self._session.client.cut()

    async def read_waiting(self, seconds: float) -> None:
        """Wait up to ``seconds`` until all messages received so far are read.

        Call it before a timeout is concluded from silence: the answer may be among them.
        """
        with suppress(TimeoutError, MqttError):
            async with asyncio.timeout(seconds):
                if session := self._session:
                    await session.client.wait_until(lambda: session.client.has_read_all)

    async def drain(self, seconds: float) -> bool:
        """Wait up to ``seconds`` until all published messages are acknowledged; return whether they are.

        Also waits for a session that is connecting: a program that has published that it is online must be
        able to publish that it is offline.
        """
        try:
            async with asyncio.timeout(seconds):
                while self._connecting or (self._session and (self._outbox or self._session.deliveries)):
                    self._settled.clear()
                    await self._settled.wait()
        except TimeoutError:
            return False
        return self._session is not None

    async def _begin_term(self) -> None:
        """Wait until the program may publish; in a new term, drop all messages of the old one."""
        while (term := self._term()) is None:  # noqa: ASYNC110 - a lease ends without an event
            await asyncio.sleep(TERM_POLL)
        if term != self.state.term:
            self._drop_waiting()
            self.state.term = term

    async def _serve_connection(self) -> None:
        async with self._make_client() as client:
            end_if_cancelled()
            session = _Session(client)
            self._connecting = True
            watching = asyncio.create_task(self._watch_term(client), name="watch the term")
            try:
                await self._begin_session(session)
                end_if_cancelled()
                await client.receive(self._handle_message)
            except MqttError:
                self._find_harmful_message(session)
                raise
            finally:
                watching.cancel()
                self._end_session(session)

    async def _watch_term(self, client: Client) -> None:
        """Close the connection at the end of the term, even if nothing is written."""
        if self._term is always:
            return
        while self._may_write():  # noqa: ASYNC110 - a lease ends without an event
            await asyncio.sleep(TERM_POLL)
        client.discard_unsent()
        client.cut()

    def _may_write(self) -> bool:
        """Return whether the lease of the connection is still valid."""
        return self._term() == self.state.term

    def _make_client(self) -> Client:
        return Client(
            self._settings,
            self._client_id,
            timeout=CONNECT_TIMEOUT,
            will=self._hooks.will(),
            may_write=self._may_write,
        )

    async def _begin_session(self, session: _Session) -> None:
        """Publish the first messages, subscribe, then publish the waiting messages."""
        for first in self._hooks.on_connected():
            if first.topic in self.state.set_aside:
                self._drop_set_aside(first)
                continue
            session.first.append(replace(first, keep=False))
            self._send_waiting(session)  # before the next one is made
            await session.client.wait_until(lambda: session.has_room)
        # the access list may have been corrected meanwhile
        self.state.refused, self.state.refused_names = (), frozenset()
        await self._send_subscriptions(session)
        self._session = session
        self.state.connected = True
        self.state.connects += 1
        self._connected_at = asyncio.get_running_loop().time()
        self.state.last_error = ""
        log.info("broker connected", host=self._settings.host, port=self._settings.port)
        self._connecting = False
        later = asyncio.get_running_loop().call_later
        later(STABLE_AFTER, self._trust_session, session)
        if self._suspects:
            later(SUSPECTED_FOR, self._clear_suspects, session)
        self._send_waiting(session)
        self._settled.set()
        if self._names:
            self._subscribe_late(session)

    async def _send_subscriptions(self, session: _Session) -> None:
        """Send all subscriptions not sent yet, including those added meanwhile; needed ones first."""
        if len(session.subscribed) == len(self._subscriptions):
            return
        while new := [each for each in self._subscriptions if each not in session.subscribed]:
            needed = [each for each in new if each.needed]
            if needed:
                new = needed[:1] if self._subscribes_singly else needed
            session.subscribed.update(new)
            # without this, an optional topic that RabbitMQ refuses would end each connection
            if wanted := [each for each in new if each.needed or each.ends < ENDS]:
                await self._subscribe_to(session, wanted)
        self._hooks.on_subscribed()

    async def _subscribe_to(self, session: _Session, new: list[_Subscription]) -> None:
        """Subscribe; name the subscription at which the broker ends the connection (RabbitMQ refuses so)."""
        try:
            granted = await session.client.subscribe([(each.topic_filter, each.qos) for each in new])
        except MqttError as error:
            # the broker does not say which one it refuses: the next connection sends needed ones one by one,
            # and optional ones are given up together, because each trial costs a connection
            if new[0].needed:
                self._subscribes_singly = True
                if len(new) > 1:
                    raise
            for each in new:
                each.ends += 1
            topics = ", ".join(each.topic_filter for each in new[:NAMES_LOGGED])
            raise MqttError(
                f"{error}; the subscription is to {topics}: check the broker's access list"
            ) from None
        # 0x80 in MQTT 3.1.1 (3.9.3); ejabberd answers 0x8F; Mosquitto grants all, and withholds messages
        refused = [
            each for each, code in zip(new, granted, strict=True) if getattr(code, "is_failure", False)
        ]
        self.state.refused += tuple(each.topic_filter for each in refused if each.needed)
        for each in refused:
            if each.needed:
                log.error("the broker refuses a subscription; check its access list", topic=each.topic_filter)
            else:
                log.warning(
                    "the broker refuses a subscription; the program works without it",
                    topic=each.topic_filter,
                )

    def _subscribe_late(self, session: _Session) -> None:
        if session.subscribing and not session.subscribing.done():
            return  # the running one also sends the new subscriptions
        session.subscribing = asyncio.create_task(self._try_to_subscribe(session), name="subscribe")

    async def _try_to_subscribe(self, session: _Session) -> None:
        try:
            await self._send_subscriptions(session)
            await self._subscribe_by_name(session)
        except MqttError as error:
            log.warning("no answer to new subscriptions, reconnecting", reason=str(error))
            session.client.cut()

    async def _subscribe_by_name(self, session: _Session) -> None:
        """Subscribe to topics by name, some at once: a broker may take milliseconds for each.

        With QoS 0, because NATS grants a connection only about 60 subscriptions of QoS 1
        (``max_ack_pending``); the wildcard subscription keeps its own.
        """
        while names := self._names[session.subscribed_by_name :][:NAMES_AT_ONCE]:
            if self._ends_at_names == ENDS:
                log.warning(
                    "the broker ends connections that subscribe by name; doing without", topic=names[0]
                )
                return
            self._ends_at_names += 1  # unless it answers
            session.subscribed_by_name += len(names)
            granted = await session.client.subscribe([(name, 0) for name in names])
            self._ends_at_names = 0
            refused = [
                each for each, code in zip(names, granted, strict=True) if getattr(code, "is_failure", False)
            ]
            if refused:
                log.warning(
                    "the broker refuses topics: rename what they are named after",
                    topics=refused[:NAMES_LOGGED],
                    number=len(refused),
                )
                self.state.refused_names |= frozenset(refused)
            await self._send_subscriptions(session)  # what was added meanwhile

    def _end_session(self, session: _Session) -> None:
        """Requeue unacknowledged messages, in order, before the waiting ones."""
        in_flight = (message for message, _ in session.deliveries.values())
        unsent = [*in_flight, *session.first, *self._outbox]
        session.deliveries.clear()
        session.first.clear()
        self._connecting = False
        self._settled.set()
        if session.subscribing:
            session.subscribing.cancel()
        self._outbox.clear()
        for message in unsent:
            if message.topic in self.state.set_aside:
                self._drop_set_aside(message)
            # 0022: a message of an ended term may be outdated by what the new leader has sent
            elif message.keep and self._may_write():
                self._queue_message(message)
            else:
                self.state.dropped += 1
        if self._session is session:
            self._session = None
            self.state.connected = False
            self._hooks.on_lost()

    def _find_harmful_message(self, session: _Session) -> None:
        """Find out whether the connection has ended because of a message."""
        if self._silence or not session.client.closed_by_broker or not self._may_write():
            return  # the broker has not ended it
        since = monotonic() - SOON
        sent = [(message.topic, at) for message, at in session.deliveries.values()]
        if sent and sent[0][1] < since:
            return  # the broker had not answered for some time
        written = {topic for topic, at in session.unacknowledged if at >= since}
        self._ended_alone = bool(session.alone)
        alone = len(sent) == 1 and not written
        refused = self._suspects.note_end(written.union(topic for topic, _ in sent), alone=alone)
        if refused is None:
            return
        self.state.set_aside[refused] = 0
        if len(self.state.set_aside) > SET_ASIDE_LIMIT:
            del self.state.set_aside[next(iter(self.state.set_aside))]
        log.error(
            "the broker has ended the connection twice at a message; messages on its topic are set aside. "
            "Check the broker's access list and limits, and whether it accepts such a topic",
            topic=refused,
            tried_again_after=SET_ASIDE_FOR,
        )
        asyncio.get_running_loop().call_later(SET_ASIDE_FOR, self._try_again, refused)

    def _try_again(self, topic: str) -> None:
        """Send the next message on a topic that was set aside; one more end of a connection sets it aside."""
        if self.state.set_aside.pop(topic, None) is None:
            return
        self._suspects.add_refused(topic)
        if self._session:
            asyncio.get_running_loop().call_later(SUSPECTED_FOR, self._clear_suspects, self._session)

    def _drop_set_aside(self, message: Outbound) -> None:
        self.state.set_aside[message.topic] += 1
        self.state.dropped += 1

    def _handle_message(self, inbound: Inbound) -> None:
        self.state.received += 1
        handlers = self._handlers(inbound.topic)
        if not handlers and self._session and not self._session.told_of_strays:
            self._session.told_of_strays = True
            log.error(
                "the broker delivers on a topic that was not subscribed to; it is ignored",
                topic=inbound.topic,
            )
        for handler in handlers:
            try:
                handler(inbound)
            except Exception as error:  # noqa: BLE001 - it is reported
                self.state.handler_failures += 1
                size = len(inbound.payload)
                report_failure("message handler failed", error, topic=inbound.topic, size=size)

    def _matching_handlers(self, topic: str) -> tuple[Handler, ...]:
        return tuple(
            subscription.handler
            for subscription in self._subscriptions
            if topic_matches_sub(subscription.topic_filter, topic)
        )

    def _drop_waiting(self) -> None:
        self.state.dropped += len(self._outbox)
        self._outbox.clear()

    def _queue_message(self, message: Outbound) -> None:
        dropped = self._outbox.add(message)
        if dropped is None:
            return
        self.state.dropped += 1
        self._drops_to_log += 1
        now = monotonic()
        if now - self._drops_logged_at >= DROPS_LOGGED_EVERY:
            log.error(
                "the queue to the broker is full; dropping its oldest messages that are not retained",
                dropped=self._drops_to_log,
                limit=self._settings.outgoing_limit,
                topic=dropped.topic,
            )
            self._drops_to_log, self._drops_logged_at = 0, now

    def _may_send(self, session: _Session, message: Outbound) -> bool:
        """Return whether the message may be in flight now: a suspect only alone, once subscribed."""
        if not self._suspects:
            return session.has_room
        if message.topic in self._suspects:
            ready = session is self._session and not session.deliveries
            return ready and (session.stable or not self._suspects.near_refusal(message.topic))
        return session.has_room and not session.alone

    def _send_message(self, session: _Session, message: Outbound) -> None:
        session.sent += 1
        number = session.sent
        now = monotonic()
        session.deliveries[number] = message, now
        if self._suspects and message.qos == 0:
            message = replace(message, qos=1)  # the acknowledgement shows that the broker accepts it
        try:
            session.client.send(message, partial(self._confirm_delivery, session, number))
        except MqttError:
            return  # the connection is about to end, which requeues `deliveries`
        except ValueError as error:
            del session.deliveries[number]
            self.state.dropped += 1
            log.error("dropping a message that cannot be sent", topic=message.topic, reason=str(error))  # noqa: TRY400
            return
        if message.qos == 0:
            session.unacknowledged.append((message.topic, now))
        elif message.topic in self._suspects:
            session.alone = number
            asyncio.get_running_loop().call_later(SOON, self._waited_for_end, session, number)

    def _confirm_delivery(self, session: _Session, number: int) -> None:
        delivery = session.deliveries.pop(number, None)
        if delivery is None:
            return  # it was requeued
        if number == session.alone:
            session.alone = 0
            self._suspects.clear(delivery[0].topic)
        self.state.published += 1
        self._send_waiting(session)
        if not session.deliveries:
            self._settled.set()

    def _waited_for_end(self, session: _Session, number: int) -> None:
        """Clear all suspects: the broker acknowledges none at present, and has not ended the connection."""
        if number == session.alone:
            session.alone = 0
            self._clear_suspects(session)

    def _trust_session(self, session: _Session) -> None:
        session.stable = True
        self._send_waiting(session)

    def _clear_suspects(self, session: _Session) -> None:
        """Clear all suspects, such as those that were not sent again since the connect."""
        if session is self._session:
            self._suspects = Suspects()
            self._send_waiting(session)

    def _send_waiting(self, session: _Session) -> None:
        """Send waiting messages, as far as they may be in flight."""
        while session.first or (self._outbox and session is self._session):
            first = session.first[0] if session.first else next(iter(self._outbox))
            if not self._may_send(session, first):
                return
            self._send_message(session, session.first.popleft() if session.first else self._outbox.pop())

    def _log_suspicion(self) -> None:
        log.error(
            "connections end immediately; check whether another program uses this client ID "
            "at the broker, for a robot one with the same serial number",
            client_id=self._client_id,
            tried_at_most_every=self._settings.reconnect_max,
        )

    def _log_failure(self, error: Exception, *, lost: bool) -> None:
        text = str(error.__cause__ or error) or type(error).__name__
        if text != self.state.last_error:
            log.warning(
                "broker connection lost" if lost else "broker not reachable, retrying",
                host=self._settings.host,
                port=self._settings.port,
                reason=text,
            )
        self.state.last_error = text
