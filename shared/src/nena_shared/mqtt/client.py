"""A connection to an MQTT broker (MQTT 3.1.1), with paho-mqtt in an asyncio event loop.

paho connects, subscribes and sends keep-alives, through its documented interface for external event loops.
Used alone, it costs 50 % more per message (figures in decision 0002): it calls the socket four times for each
packet read and once for each packet written, and creates objects with locks for each message. Therefore it
uses a :class:`_Stream` instead of the socket, which handles plain messages and their acknowledgements before
paho sees them.
"""

from __future__ import annotations

import asyncio
import select
import socket
import ssl
import struct
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Any, Self, cast

from paho.mqtt.client import Client as PahoClient
from paho.mqtt.client import MQTTMessage, error_string
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.reasoncodes import ReasonCode

from nena_shared.log import get_logger
from nena_shared.mqtt.identity import tls_context
from nena_shared.mqtt.message import Inbound, Outbound
from nena_shared.mqtt.packets import (
    CHUNK,
    PINGREQ,
    PINGRESP,
    PacketReader,
    Published,
    acknowledgements,
    publication,
)
from nena_shared.settings import MqttSettings
from nena_shared.tasks import set_within

log = get_logger(__name__)

READ_AT_ONCE = 4
"""Maximum packets read in one iteration of the event loop; the order service takes milliseconds for each."""

WRITE_AT_ONCE = 16
"""Maximum chunks written in one iteration of the event loop."""

DISCONNECT_TIMEOUT = 2.0
"""Timeout for the broker to read DISCONNECT, which comes after all unread data, seconds."""

KEEP_ALIVE_INTERVAL = 1.0
"""Interval of calls to paho's ``loop_misc``, seconds."""

OWN_PACKET_IDS = range(0x8000, 0x10000)
"""Packet identifiers of published messages; paho uses those from 1 for its subscriptions."""

CLOSED_AT_ONCE = "the broker closed the connection right after it accepted it"
NOT_ACCEPTED = (
    "before it accepted the connection; check whether it expects TLS on this port or a different "
    "certificate (mqtt.tls)"
)
NO_ANSWER = "the broker did not answer in time"
LONG = 1_000_000
"""Bytes from which on a message may be the reason why a broker closes the connection."""
NO_MESSAGE = (0, "", 0)
"""Length, topic and packet identifier of the longest unconfirmed message with QoS 1, if there is none."""
CLOSED_UNANSWERED = "the connection ended before the broker answered a subscription"
NOT_CONNECTED = "not connected"
NOT_PERMITTED = "the program may no longer publish"

Receive = Callable[[Inbound], None]
Confirmed = Callable[[], None]


class MqttError(Exception):
    """The connection could not be established, or has ended; the message explains why."""


class _Stream:
    """Replaces paho's socket, to read and write in large pieces.

    paho can only read complete packets that were offered to it. Its output is buffered until :meth:`flush`,
    so it never waits for the socket.
    """

    def __init__(self, sock: socket.socket) -> None:
        self.sock = sock
        self.reader = PacketReader(self._receive)
        self.queued = 0
        """Total number of bytes added."""
        self.ping_sent = False
        """Whether paho waits for PINGRESP."""
        self._outgoing = bytearray()

    @property
    def waiting(self) -> int:
        """Number of bytes not yet accepted by the socket."""
        return len(self._outgoing)

    @property
    def has_more(self) -> bool:
        """Whether data is available that the socket does not report."""
        decrypted = self.sock.pending() if isinstance(self.sock, ssl.SSLSocket) else 0
        return self.reader.ready or bool(decrypted)

    @property
    def has_unread(self) -> bool:
        """Whether any received data has not been read."""
        if self.has_more:
            return True
        poll = select.poll()
        poll.register(self.sock, select.POLLIN)
        return bool(poll.poll(0))

    def add(self, data: bytes) -> None:
        """Queue bytes to be written."""
        self._outgoing += data
        self.queued += len(data)

    def flush(self) -> None:
        """Write as much as the socket accepts now.

        Raises:
            OSError: the connection is broken.
        """
        for _ in range(WRITE_AT_ONCE):
            if not self._outgoing:
                return
            try:
                count = self.sock.send(self._outgoing[:CHUNK])
            except (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
                return
            del self._outgoing[:count]

    def recv(self, bufsize: int) -> bytes:
        """Return bytes of the packet offered to paho."""
        return self.reader.read(bufsize)

    def send(self, data: bytes | bytearray) -> int:
        """Queue a packet of paho."""
        self.ping_sent = self.ping_sent or data[0] == PINGREQ
        self.add(bytes(data))
        return len(data)

    def do_handshake(self) -> None:
        """Perform the TLS handshake, if TLS is used."""
        if isinstance(self.sock, ssl.SSLSocket):
            self.sock.do_handshake()

    def settimeout(self, seconds: float | None) -> None:
        """Set the timeout of the handshake."""
        self.sock.settimeout(seconds)

    def setblocking(self, flag: bool) -> None:  # noqa: FBT001 - as sockets have it
        """Set whether calls block."""
        self.sock.setblocking(flag)

    def fileno(self) -> int:
        """Return the socket's file descriptor."""
        return self.sock.fileno()

    def close(self) -> None:
        """Leave the socket open; :class:`Client` closes it once everything is written."""

    def _receive(self, bufsize: int) -> bytes:
        try:
            return self.sock.recv(bufsize)
        except (ssl.SSLWantReadError, ssl.SSLWantWriteError) as error:
            raise BlockingIOError from error


class _StreamMaker:
    """Replaces paho's SSL context, which wraps the socket; used without TLS as well."""

    check_hostname = True
    """paho does not need to check host names, as the SSL context does."""

    def __init__(self, tls: ssl.SSLContext | None) -> None:
        self._tls = tls
        self.stream: _Stream | None = None

    def wrap_socket(self, sock: socket.socket, server_hostname: str | None = None, **options: Any) -> _Stream:  # noqa: ANN401 - as SSL contexts have it
        # otherwise small messages are delayed by up to 44 ms
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if self._tls:
            sock = self._tls.wrap_socket(sock, server_hostname=server_hostname, **options)
        self.stream = _Stream(sock)
        return self.stream


class Client:
    """A connection, as an asynchronous context manager that connects and disconnects.

    Messages are queued until :meth:`receive`. The socket is always closed, even if the broker does not answer
    CONNECT or does not read DISCONNECT. Otherwise connections would pile up at a broker that hangs; when it
    resumes, each would take over the client ID of the previous one, and all last wills would be published.
    """

    _rest_due = False
    """Whether data is written at the end of this iteration of the event loop."""
    _wrote = False
    """Whether data was written in this iteration of the event loop already."""
    _reading = False
    """Whether outgoing messages wait for the end of a read."""

    def __init__(
        self,
        settings: MqttSettings,
        client_id: str,
        *,
        timeout: float,
        will: Outbound | None = None,
        may_write: Callable[[], bool] = lambda: True,
    ) -> None:
        """Prepare the connection.

        Args:
            settings: address and TLS settings of the broker.
            client_id: MQTT client ID, unique at the broker.
            timeout: timeout of CONNECT and SUBSCRIBE, seconds.
            will: published by the broker if the connection ends without DISCONNECT.
            may_write: called before each write to the socket; False ends the connection without writing.

        Raises:
            ConfigurationError: the password file or a TLS file cannot be read.
        """
        self._settings = settings
        self._timeout = timeout
        self._may_write = may_write
        self._loop = asyncio.get_running_loop()
        self._accepted: asyncio.Future[None] = self._loop.create_future()
        self._ended: asyncio.Future[None] = self._loop.create_future()
        self._drained = asyncio.Event()
        self._subscribing: dict[int, asyncio.Future[list[ReasonCode]]] = {}
        self._receive: Receive | None = None
        self._early: deque[Inbound] = deque()
        self._unconfirmed: dict[int, Confirmed] = {}
        self._longest = NO_MESSAGE
        self._unwritten: deque[tuple[int, Confirmed]] = deque()
        """Messages without acknowledgement (QoS 0), with the byte count after which they are written."""
        self._packet_id = OWN_PACKET_IDS.stop
        self._keeping_alive: asyncio.Task[None] | None = None
        self._reads_on = False
        """Whether the next iteration of the event loop continues reading, even if nothing new arrives."""
        self._awaits_socket = False
        self._arriving = False
        """Whether data has arrived since the last keep-alive check."""
        self._maker = _StreamMaker(tls_context(settings.tls))
        self._paho = self._make_paho(client_id, will)
        self.dropped = 0
        """Number of messages that were dropped before :meth:`receive`, beyond ``incoming_limit``."""
        self.closed_by_broker = False
        """Whether the connection has ended without this program's keep-alive or timeout."""

    @property
    def socket(self) -> socket.socket | None:
        """The socket of an open connection."""
        stream = self._maker.stream
        return stream.sock if stream and stream.fileno() >= 0 else None

    async def __aenter__(self) -> Self:
        """Connect to the broker.

        Raises:
            MqttError: the broker refused the connection, closed it or did not answer.
            OSError: the broker cannot be reached, or TLS failed.

        """
        connecting = self._loop.run_in_executor(None, self._connect)
        try:
            async with asyncio.timeout(self._timeout):
                await asyncio.shield(connecting)
                self._begin()
                await asyncio.shield(self._accepted)
        except TimeoutError:
            self._discard(connecting)
            raise MqttError(NO_ANSWER) from None
        except BaseException:
            self._discard(connecting)
            raise
        if self._ended.done():
            raise MqttError(CLOSED_AT_ONCE)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Disconnect, gracefully if the broker reads DISCONNECT within :data:`DISCONNECT_TIMEOUT`."""
        self._receive = _ignore
        try:
            if not self._ended.done():
                self._paho.disconnect()
                self._drained.clear()
                self._flush()
                await set_within(self._drained, min(self._timeout, DISCONNECT_TIMEOUT))
        finally:
            self._close()

    async def subscribe(self, topic_filters: list[tuple[str, int]]) -> list[ReasonCode]:
        """Subscribe to topic filters with their QoS; return the broker's reason codes.

        Raises:
            MqttError: the broker did not answer, or the connection has ended.

        """
        if self._ended.done():
            raise MqttError(CLOSED_UNANSWERED)
        _, mid = self._paho.subscribe(topic_filters)
        assert mid is not None, "paho is connected"  # noqa: S101 - for the type
        answer: asyncio.Future[list[ReasonCode]] = self._loop.create_future()
        self._subscribing[mid] = answer
        self._flush()
        try:
            async with asyncio.timeout(self._timeout):
                return await answer
        except TimeoutError:
            raise MqttError(NO_ANSWER) from None
        finally:
            self._subscribing.pop(mid, None)

    async def receive(self, receive: Receive) -> None:
        """Call ``receive`` with all messages, queued ones first, until the connection ends.

        It is called from the event loop and must not raise.

        Raises:
            MqttError: the connection has ended.

        """
        while self._early:
            receive(self._early.popleft())
        self._receive = receive
        await asyncio.shield(self._ended)

    def send(self, message: Outbound, confirmed: Confirmed) -> None:
        """Publish messages in the order of the calls; call ``confirmed`` when the broker acknowledges it.

        With QoS 0, it is called when the message is written. The first message in an iteration of the event
        loop is written immediately unless it is retained, as statuses are; later ones, and those sent while
        receiving, are written together.

        Raises:
            MqttError: the connection has ended.
            ValueError: the topic is invalid for publishing, or the message is too long.

        """
        stream = self._maker.stream
        if stream is None or self._ended.done():
            raise MqttError(NOT_CONNECTED)
        self._add(stream, message, confirmed)
        if self._reading:
            return
        if not self._rest_due:
            self._rest_due = True
            self._loop.call_soon(self._write_rest)
        if not (message.retain or self._wrote):
            self._wrote = True
            self._flush()

    def discard(self) -> None:
        """Make the kernel drop unsent data when the connection is closed."""
        if sock := self.socket:
            with suppress(OSError):  # it is broken already
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))

    @property
    def has_unread(self) -> bool:
        """Whether received messages wait to be read."""
        stream = self._maker.stream
        return stream is not None and not self._ended.done() and stream.has_unread

    def cut(self) -> None:
        """Break the connection without DISCONNECT, so that the broker publishes the last will."""
        if sock := self.socket:
            with suppress(OSError):  # it is broken already
                sock.shutdown(socket.SHUT_RDWR)

    def _make_paho(self, client_id: str, will: Outbound | None) -> PahoClient:
        made = PahoClient(CallbackAPIVersion.VERSION2, client_id=client_id, clean_session=True)
        made.connect_timeout = self._timeout
        made.max_inflight_messages_set(0)
        made.username_pw_set(self._settings.username, self._settings.secret())
        made.tls_set_context(cast("ssl.SSLContext", self._maker))
        if will:
            made.will_set(will.topic, will.payload, will.qos, will.retain)
        made.on_connect = self._on_connect
        made.on_disconnect = self._on_disconnect
        made.on_subscribe = self._on_subscribe
        made.on_message = self._on_message
        made.on_publish = self._on_publish
        return made

    def _connect(self) -> None:
        """Open the connection, in a thread. The event loop writes CONNECT."""
        self._paho.connect(self._settings.host, self._settings.port, self._settings.keep_alive)

    def _begin(self) -> None:
        self._keeping_alive = self._loop.create_task(self._keep_alive(), name="keep alive")
        assert self._maker.stream, "paho has connected"  # noqa: S101 - for the type
        self._loop.add_reader(self._maker.stream.fileno(), self._on_readable)
        self._flush()

    def _discard(self, connecting: asyncio.Future[None]) -> None:
        """Close the socket, as soon as it is open, without writing CONNECT."""

        def discard(done: asyncio.Future[None]) -> None:
            done.exception()  # asyncio logs exceptions that are never retrieved
            self._close()

        if connecting.done():
            self._close()
        else:
            connecting.add_done_callback(discard)

    def _add(self, stream: _Stream, message: Outbound, confirmed: Confirmed) -> None:
        if message.qos == 1:
            packet_id = self._next_packet_id()
            stream.add(publication(message, packet_id))
            self._unconfirmed[packet_id] = confirmed
            self._longest = max(self._longest, (len(message.payload), message.topic, packet_id))
        elif message.qos == 0:
            stream.add(publication(message))
            self._unwritten.append((stream.queued, confirmed))
        else:
            sent = self._paho.publish(message.topic, message.payload, message.qos, message.retain)
            self._unconfirmed[sent.mid] = confirmed

    def _next_packet_id(self) -> int:
        self._packet_id += 1
        if self._packet_id >= OWN_PACKET_IDS.stop:
            self._packet_id = OWN_PACKET_IDS.start
        return self._packet_id

    def _on_readable(self) -> None:
        if not self._reads_on:
            self._read()

    def _read(self) -> None:
        """Read available packets, up to a limit per iteration of the event loop, and write the answers."""
        self._reads_on = False
        stream = self._maker.stream
        if stream is None or self._ended.done():
            return
        self._reading = True
        try:
            self._read_packets(stream)
        except Exception as error:  # noqa: BLE001 - paho raises various exceptions for malformed packets
            self._end(f"unreadable packet from the broker: {error}")
        finally:
            self._reading = False
        self._flush()
        if not self._ended.done() and stream.has_more:
            self._reads_on = True
            self._loop.call_soon(self._read)

    def _read_packets(self, stream: _Stream) -> None:
        reader = stream.reader
        if not reader.ready and reader.fill():
            self._arriving = True
        received = []
        for _ in range(READ_AT_ONCE):
            packet = reader.next_packet(self._unconfirmed)
            if isinstance(packet, Published):
                self._deliver(Inbound(packet.topic, packet.payload, packet.retained, packet.qos))
                if packet.qos:
                    received.append(packet.packet_id)
            elif isinstance(packet, int):
                self._confirm(packet)
            elif packet:
                stream.ping_sent = stream.ping_sent and packet.head != PINGRESP
                self._let_paho_read()
            elif why := reader.why_ended:
                self.closed_by_broker = True
                self._end(why)
                return
            else:
                break
        if received:
            stream.add(acknowledgements(received))

    def _let_paho_read(self) -> None:
        if problem := self._paho.loop_read():
            self._end(error_string(problem))
        elif self._paho.want_write():
            self._paho.loop_write()

    def _deliver(self, message: Inbound) -> None:
        if self._receive:
            self._receive(message)
        elif len(self._early) < self._settings.incoming_limit:
            self._early.append(message)
        else:
            if not self.dropped:
                log.warning(
                    "dropping messages that arrive while connecting",
                    limit=self._settings.incoming_limit,
                )
            self.dropped += 1

    def _write_rest(self) -> None:
        """Write the other messages of an iteration of the event loop."""
        self._rest_due = self._wrote = False
        self._flush()

    def _flush(self) -> None:
        """Write the buffered data; what the socket does not accept is written when it is ready again."""
        stream = self._maker.stream
        if stream is None or self._ended.done():
            return
        if stream.waiting:
            if not self._may_write():
                self.discard()
                self._end(NOT_PERMITTED)
                return
            try:
                stream.flush()
            except OSError as error:
                self.closed_by_broker = True
                self._end(f"the connection broke: {error}")
                return
        written = stream.queued - stream.waiting
        while self._unwritten and self._unwritten[0][0] <= written:
            self._unwritten.popleft()[1]()
        self._await_socket(stream)

    def _await_socket(self, stream: _Stream) -> None:
        """Continue writing when the socket accepts more."""
        if not stream.waiting:
            self._drained.set()
        if bool(stream.waiting) is not self._awaits_socket:
            self._awaits_socket = bool(stream.waiting)
            if self._awaits_socket:
                self._loop.add_writer(stream.fileno(), self._flush)
            else:
                self._loop.remove_writer(stream.fileno())

    async def _keep_alive(self) -> None:
        """Let paho send PINGREQ and detect a broker that no longer answers.

        Not while messages arrive and PINGRESP is awaited, as it may come after them.
        """
        stream = self._maker.stream
        while stream and not self._ended.done():
            await asyncio.sleep(KEEP_ALIVE_INTERVAL)
            arriving, self._arriving = self._arriving, False
            if not (arriving and stream.ping_sent):
                self._paho.loop_misc()
                self._flush()

    def _confirm(self, packet_id: int) -> None:
        if confirmed := self._unconfirmed.pop(packet_id, None):
            confirmed()
        if self._longest[2] == packet_id:
            self._longest = NO_MESSAGE

    def _end(self, why: str) -> None:
        """End the connection without DISCONNECT; raise MqttError(``why``) in all waiting tasks."""
        if self._ended.done():
            return
        why += self._possible_reason()
        self._ended.set_exception(MqttError(why))
        self._ended.exception()  # asyncio logs exceptions that are never retrieved
        if not self._accepted.done():
            self._accepted.set_exception(MqttError(f"{why} {NOT_ACCEPTED}"))
            self._accepted.exception()
        for answer in self._subscribing.values():
            if not answer.done():
                answer.set_exception(MqttError(CLOSED_UNANSWERED + self._possible_reason()))
        self._close()

    def _possible_reason(self) -> str:
        """Name the longest message if it is long: MQTT 3.1.1 has no answer for a refused one."""
        length, topic, _ = self._longest
        if length < LONG:
            return ""
        return (
            f"; the broker may refuse a message of {length / 1e6:.1f} MB on {topic}: "
            "check its limit (Mosquitto: max_packet_size)"
        )

    def _close(self) -> None:
        """Close the socket; buffered data is discarded."""
        if not self._ended.done():
            self._ended.set_exception(MqttError(NOT_CONNECTED))
            self._ended.exception()
        self._drained.set()
        if self._keeping_alive:
            self._keeping_alive.cancel()
        if sock := self.socket:
            self._loop.remove_reader(sock.fileno())
            self._loop.remove_writer(sock.fileno())
            sock.close()

    def _on_connect(
        self, _client: PahoClient, _userdata: object, _flags: object, reason: ReasonCode, _properties: object
    ) -> None:
        if self._accepted.done():
            return
        if reason.is_failure:
            self._accepted.set_exception(MqttError(str(reason)))
            self._accepted.exception()
        else:
            self._accepted.set_result(None)

    def _on_disconnect(
        self, _client: PahoClient, _userdata: object, _flags: object, reason: ReasonCode, _properties: object
    ) -> None:
        if reason.is_failure:
            self._end(str(reason))

    def _on_subscribe(
        self,
        _client: PahoClient,
        _userdata: object,
        mid: int,
        reasons: list[ReasonCode],
        _properties: object,
    ) -> None:
        answer = self._subscribing.get(mid)
        if answer and not answer.done():
            answer.set_result(reasons)

    def _on_message(self, _client: PahoClient, _userdata: object, message: MQTTMessage) -> None:
        """Deliver a message that only paho can read, e.g. with QoS 2."""
        self._deliver(Inbound(message.topic, bytes(message.payload), message.retain, message.qos))

    def _on_publish(self, _client: PahoClient, _userdata: object, mid: int, *_: object) -> None:
        self._confirm(mid)


def _ignore(_message: Inbound) -> None:
    """Ignore a message that arrives while the connection is being closed."""
