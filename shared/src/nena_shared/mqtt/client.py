"""A connection to an MQTT broker (MQTT 3.1.1), with paho-mqtt in an asyncio event loop.

paho is used by its documented interface for external event loops only: the loop calls ``loop_read`` when
data has arrived, ``loop_write`` when paho wants to write, and ``loop_misc`` every second (decision 0106).
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
from dataclasses import dataclass, field
from types import TracebackType
from typing import TYPE_CHECKING, Self, cast

from paho.mqtt.client import Client as PahoClient
from paho.mqtt.client import MQTTMessage, error_string
from paho.mqtt.enums import CallbackAPIVersion, LogLevel, MQTTErrorCode
from paho.mqtt.reasoncodes import ReasonCode

from nena_shared.log import get_logger
from nena_shared.mqtt.identity import tls_context
from nena_shared.settings import MqttSettings

if TYPE_CHECKING:
    from paho.mqtt.client import SocketLike

log = get_logger(__name__)

DISCONNECT_TIMEOUT = 2.0
"""Timeout for the broker to read DISCONNECT, which comes after all unread data, seconds."""

KEEP_ALIVE_INTERVAL = 1.0
"""Interval of calls to paho's ``loop_misc``, seconds."""

CLOSED = "the broker closed the connection"
CLOSED_AT_ONCE = "the broker closed the connection right after it accepted it"
CLOSED_UNANSWERED = "the connection ended before the broker answered a subscription"
NOT_ACCEPTED = (
    "before it accepted the connection; check whether this port is one for MQTT, whether it expects TLS or a "
    "different certificate (mqtt.tls), and whether it allows the last will: a retained message of QoS 1"
)
NO_ANSWER = "the broker did not answer in time"
NO_MQTT = f"{NO_ANSWER}; check whether this port is one for MQTT"
NOT_CONNECTED = "not connected"
NOT_PERMITTED = "the program may no longer publish"

LONG = 1_000_000
"""Bytes from which on a message may be the reason why a broker closes the connection."""


@dataclass(frozen=True, slots=True)
class Inbound:
    """A message that the broker delivered."""

    topic: str
    payload: bytes
    retained: bool
    """Whether the broker had retained it before the subscription."""
    qos: int = field(default=0, compare=False)
    """Quality of service: the lower of the sender's and the subscription's."""


@dataclass(frozen=True, slots=True)
class Outbound:
    """A message to publish."""

    topic: str
    payload: bytes
    qos: int = 1
    retain: bool = False
    keep: bool = True
    """Whether to queue it while the link is down and resend it after a disconnect."""


Receive = Callable[[Inbound], None]
Confirmed = Callable[[], None]


class MqttError(Exception):
    """The connection could not be established, or has ended; the message explains why."""


class Client:
    """A connection, as an asynchronous context manager that connects and disconnects.

    Messages are queued until :meth:`receive`. The socket is always closed, even if the broker does not answer
    CONNECT or does not read DISCONNECT. Otherwise connections would pile up at a broker that hangs; when it
    resumes, each would take over the client ID of the previous one, and all last wills would be published.
    """

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
        self._progress = asyncio.Event()
        """Set after each read and write, and at the end of the connection."""
        self._subscribing: dict[int, asyncio.Future[list[ReasonCode]]] = {}
        self._receive: Receive | None = None
        self._arrived: deque[Inbound] = deque()
        """Messages that are not handed out yet, because paho still reads or nobody receives."""
        self._unconfirmed: dict[int, tuple[Outbound, Confirmed]] = {}
        self._confirmed: deque[Confirmed] = deque()
        self._keeping_alive: asyncio.Task[None] | None = None
        self._awaits_socket = False
        """Whether the event loop reports when the socket accepts more data."""
        self._broke_by = ""
        """The operating system's reason why the connection broke; empty if the broker closed it."""
        self._paho = self._make_paho(client_id, will)
        self.dropped = 0
        """Number of messages that were dropped before :meth:`receive`, beyond ``incoming_limit``."""
        self.closed_by_broker = False
        """Whether the connection has ended without this program's keep-alive or timeout."""

    @property
    def socket(self) -> socket.socket | None:
        """The socket of an open connection."""
        sock = cast("socket.socket | None", self._paho.socket())
        return sock if sock and sock.fileno() >= 0 else None

    async def __aenter__(self) -> Self:
        """Connect to the broker.

        Raises:
            MqttError: the broker refused the connection, closed it or did not answer.
            OSError: the broker cannot be reached, or TLS failed.
        """
        address = self._settings.host, self._settings.port, self._settings.keep_alive
        # in a thread: paho looks up the host and connects in one blocking call
        connecting = self._loop.run_in_executor(None, lambda: self._paho.connect(*address))  # writes nothing
        try:
            async with asyncio.timeout(self._timeout):
                await asyncio.shield(connecting)
                self._attach_socket()
                await asyncio.shield(self._accepted)
        except BaseException as error:
            # also after a cancellation: the thread goes on, and its socket would stay open
            connecting.add_done_callback(self._close_late_socket)
            if isinstance(error, TimeoutError):
                raise MqttError(NO_MQTT) from None
            raise
        if self._ended.done():
            raise MqttError(CLOSED_AT_ONCE)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Disconnect, gracefully if the broker reads DISCONNECT within :data:`DISCONNECT_TIMEOUT`."""
        self._receive = _ignore_message
        try:
            if not self._ended.done():
                self._paho.disconnect()
                self._write_packets()
                await asyncio.wait({self._ended}, timeout=min(self._timeout, DISCONNECT_TIMEOUT))
        finally:
            self._end_connection(NOT_CONNECTED)

    async def subscribe(self, topic_filters: list[tuple[str, int]]) -> list[ReasonCode]:
        """Subscribe to topic filters with their QoS; return the broker's reason codes.

        Raises:
            MqttError: the broker did not answer, or the connection has ended.
        """
        # CONNACK and the end may come in one read: then `_accepted` has succeeded already
        if self._ended.done():
            raise MqttError(CLOSED_UNANSWERED)
        _, mid = self._paho.subscribe(topic_filters)
        assert mid is not None, "paho is connected"  # noqa: S101 - for the type
        answer: asyncio.Future[list[ReasonCode]] = self._loop.create_future()
        self._subscribing[mid] = answer
        self._write_packets()
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
        self._receive = receive
        self._hand_out()
        await asyncio.shield(self._ended)

    def send(self, message: Outbound, confirmed: Confirmed) -> None:
        """Publish messages in the order of the calls; call ``confirmed`` when the broker acknowledges it.

        With QoS 0, it is called when the message is written. Each message is written at once, before the next
        one reaches paho, so that a program that was frozen in between checks again whether it may write.

        Raises:
            MqttError: the connection has ended.
            ValueError: the topic is invalid for publishing, or the message is too long.
        """
        if self._ended.done():
            raise MqttError(NOT_CONNECTED)
        sent = self._paho.publish(message.topic, message.payload, message.qos, message.retain)
        if sent.rc:  # such as a packet identifier still unacknowledged after 65,534 further messages
            self._end_connection(error_string(sent.rc))
            raise MqttError(NOT_CONNECTED)
        # before the write: with QoS 0, paho confirms the message during it
        self._unconfirmed[sent.mid] = message, confirmed
        self._write_packets()

    async def wait_until(self, condition: Callable[[], bool]) -> None:
        """Wait until a condition holds after some read or write.

        Raises:
            MqttError: the connection has ended.
        """
        while not condition():
            if self._ended.done():
                self._ended.result()  # raises the reason
            self._progress.clear()
            await self._progress.wait()

    @property
    def has_read_all(self) -> bool:
        """Whether no received message waits to be read."""
        # poll: select refuses descriptors above 1,023
        sock, poll = self.socket, select.poll()
        if sock is None:
            return True
        poll.register(sock, select.POLLIN)
        return not (_has_decrypted(sock) or poll.poll(0))

    def discard_unsent(self) -> None:
        """Make the kernel drop unsent data when the connection is closed."""
        if sock := self.socket:
            with suppress(OSError):  # it is broken already
                # a reset instead of a regular end, before which the kernel would still send what it has
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))

    def cut(self) -> None:
        """Break the connection without DISCONNECT, so that the broker publishes the last will."""
        if sock := self.socket:
            with suppress(OSError):  # it is broken already
                sock.shutdown(socket.SHUT_RDWR)

    def _make_paho(self, client_id: str, will: Outbound | None) -> PahoClient:
        # the link reconnects, with its own delays; a clean session brings no old commands
        paho = PahoClient(
            CallbackAPIVersion.VERSION2, client_id=client_id, clean_session=True, reconnect_on_failure=False
        )
        paho.connect_timeout = self._timeout
        paho.max_inflight_messages_set(0)  # the link limits them
        paho.username_pw_set(self._settings.username, self._settings.secret())
        if context := tls_context(self._settings.tls):
            paho.tls_set_context(context)
        if will:
            paho.will_set(will.topic, will.payload, will.qos, will.retain)
        paho.on_socket_register_write = _leave_writing  # or paho would write in the thread that connects
        paho.on_socket_close = self._on_socket_close
        paho.on_connect = self._on_connect
        paho.on_disconnect = self._on_disconnect
        paho.on_subscribe = self._on_subscribe
        paho.on_message = self._on_message
        paho.on_publish = self._on_publish
        paho.on_log = self._on_log
        return paho

    def _attach_socket(self) -> None:
        sock = self.socket
        assert sock, "paho has connected"  # noqa: S101 - for the type
        # otherwise small messages are delayed by up to 44 ms
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._keeping_alive = self._loop.create_task(self._check_keep_alive(), name="keep alive")
        self._loop.add_reader(sock.fileno(), self._read_packets)
        self._write_packets()

    def _close_late_socket(self, connecting: asyncio.Future[MQTTErrorCode]) -> None:
        """Close a socket that may have opened after the timeout, without writing CONNECT."""
        connecting.exception()  # asyncio logs exceptions that are never retrieved
        self._end_connection(NOT_CONNECTED)

    def _read_packets(self) -> None:
        """Let paho read: one packet, and one more for each unacknowledged message.

        The next ones are read in the next iteration of the event loop: handling each may take milliseconds.
        """
        if self._ended.done():
            return
        try:
            self._paho.loop_read()
        except Exception as error:  # noqa: BLE001 - paho raises various exceptions for malformed packets
            self._end_connection(f"unreadable packet from the broker: {error}")
        self._hand_out()
        self._write_packets()  # acknowledgements
        self._progress.set()
        if _has_decrypted(self.socket):
            self._loop.call_soon(self._read_packets)

    def _hand_out(self) -> None:
        """Hand out messages and acknowledgements, outside of paho's callbacks, in which it must not write."""
        while self._confirmed:
            self._confirmed.popleft()()
        while self._arrived and self._receive:
            self._receive(self._arrived.popleft())

    def _write_packets(self) -> None:
        """Let paho write what it was given; the rest is written when the socket accepts more."""
        sock = self.socket
        if sock is None or self._ended.done() or not self._paho.want_write():
            return
        # 0022: an order service that hung, and whose standby has taken over, must not send its old orders
        if not self._may_write():
            self.discard_unsent()
            self._end_connection(NOT_PERMITTED)
            return
        self._paho.loop_write()
        self._progress.set()
        if self._confirmed:
            # not at once: `confirmed` may send the next message, and so call this method from itself
            self._loop.call_soon(self._hand_out)
        if not self._ended.done() and self._paho.want_write() is not self._awaits_socket:
            self._awaits_socket = not self._awaits_socket
            if self._awaits_socket:
                self._loop.add_writer(sock.fileno(), self._write_packets)
            else:
                self._loop.remove_writer(sock.fileno())

    async def _check_keep_alive(self) -> None:
        """Let paho send PINGREQ and detect a broker that no longer answers."""
        while not self._ended.done():
            await asyncio.sleep(KEEP_ALIVE_INTERVAL)
            self._paho.loop_misc()
            self._write_packets()

    def _end_connection(self, why: str) -> None:
        """Close the socket without DISCONNECT; raise MqttError(``why``) in all waiting tasks."""
        if self._ended.done():
            return
        possible_reason = self._possible_reason()
        _set_error(self._ended, why + possible_reason)
        _set_error(self._accepted, f"{why} {NOT_ACCEPTED}")
        for answer in self._subscribing.values():
            _set_error(answer, CLOSED_UNANSWERED + possible_reason)
        self._progress.set()
        if self._keeping_alive:
            self._keeping_alive.cancel()
        if sock := self.socket:
            # paho does not call it for this close, and the next connection may get the same descriptor
            self._on_socket_close(self._paho, None, sock)
            sock.close()

    def _possible_reason(self) -> str:
        """Name the longest message if it is long: MQTT 3.1.1 has no answer for a refused one."""
        messages = (message for message, _ in self._unconfirmed.values())
        longest = max(messages, key=lambda message: len(message.payload), default=None)
        if longest is None or len(longest.payload) < LONG:
            return ""
        return (
            f"; the broker may refuse a message of {len(longest.payload) / 1e6:.1f} MB on {longest.topic}: "
            "check its limit (Mosquitto: max_packet_size)"
        )

    def _on_socket_close(self, _client: PahoClient, _userdata: object, sock: SocketLike) -> None:
        if sock.fileno() >= 0:
            self._loop.remove_reader(sock.fileno())
            self._loop.remove_writer(sock.fileno())

    def _on_connect(
        self, _client: PahoClient, _userdata: object, _flags: object, reason: ReasonCode, _properties: object
    ) -> None:
        if reason.is_failure:
            _set_error(self._accepted, str(reason))
        elif not self._accepted.done():
            self._accepted.set_result(None)

    def _on_disconnect(
        self, _client: PahoClient, _userdata: object, _flags: object, reason: ReasonCode, _properties: object
    ) -> None:
        if reason == "Unspecified error":  # paho's name for a lost connection
            self.closed_by_broker = True
            self._end_connection(f"the connection broke: {self._broke_by}" if self._broke_by else CLOSED)
        else:
            self._end_connection(str(reason))

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
        if self._receive or len(self._arrived) < self._settings.incoming_limit:
            payload = bytes(message.payload)
            self._arrived.append(Inbound(message.topic, payload, message.retain, message.qos))
            return
        if not self.dropped:
            limit = self._settings.incoming_limit
            log.warning("dropping messages that arrive while connecting", limit=limit)
        self.dropped += 1

    def _on_publish(self, _client: PahoClient, _userdata: object, mid: int, *_: object) -> None:
        if delivery := self._unconfirmed.pop(mid, None):
            self._confirmed.append(delivery[1])

    def _on_log(self, _client: PahoClient, _userdata: object, level: int, text: str) -> None:
        if level == LogLevel.MQTT_LOG_ERR:  # "failed to receive on socket: REASON", also of sending
            self._broke_by = text.partition("socket: ")[2] or text


def _has_decrypted(sock: socket.socket | None) -> bool:
    """Return whether TLS holds data that the socket does not report to the event loop."""
    # one read decrypts a whole TLS record, of which paho may take only a part
    return isinstance(sock, ssl.SSLSocket) and bool(sock.pending())


def _set_error(future: asyncio.Future[None] | asyncio.Future[list[ReasonCode]], why: str) -> None:
    if not future.done():
        future.set_exception(MqttError(why))
        future.exception()  # asyncio logs exceptions that are never retrieved


def _leave_writing(_client: PahoClient, _userdata: object, _sock: SocketLike) -> None:
    """Leave packets to :meth:`Client._write_packets`, which is called after whatever makes them."""


def _ignore_message(_message: Inbound) -> None:
    """Ignore a message that arrives while the connection is being closed."""
