"""aiomqtt's client, with a shorter way for messages: between the socket and those at its ends, in one step.

aiomqtt reads one packet for each turn of the event loop, puts each message into a queue, makes a task to take
it out, and wakes the loop through a pipe for each acknowledgement. Each message that is published has a task
of its own and looks at all that are not acknowledged. That is more work than most messages are worth, so
reading and writing are done directly here. Decision 0002 has the figures.
"""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from itertools import groupby
from time import monotonic
from types import TracebackType
from typing import Any, Self

import aiomqtt
from paho.mqtt.client import Client as PahoClient
from paho.mqtt.client import MQTTMessage
from paho.mqtt.enums import MQTTErrorCode

from nena_shared.mqtt.message import Inbound, Outbound
from nena_shared.mqtt.packets import (
    CHUNK,
    PUBACK,
    PUBLISH,
    Packets,
    Published,
    acknowledgements,
    publication,
)

READ_AT_ONCE = 10
"""Messages that are read before the event loop has its turn again."""

FAREWELL = 2.0
"""Seconds that a broker has to take DISCONNECT, which goes behind all that it has not taken yet."""

ENDED_AT_ONCE = "the connection has ended as soon as it stood"
UNGREETED = (
    "before it had let us in; see whether it wants TLS on this port, or another certificate (mqtt.tls)"
)
ENDED_UNANSWERED = "the connection has ended before the broker has answered a subscription"
NOT_PERMITTED = "the program no longer has the right to publish"
NOT_SENT = "the connection takes no message"

Take = Callable[[Inbound], None]
Confirmed = Callable[[], None]


class Client(aiomqtt.Client):
    """One connection: messages wait in ``messages`` until :meth:`hand_over`, which gives them away at once.

    It closes its socket whatever happens, also when the broker does not answer CONNECT or does not take
    DISCONNECT. Left open, such connections pile up at a broker that hangs; when it goes on, each takes over
    the client id of the one before, and the wills of all of them are sent.
    """

    may_write: Callable[[], bool] = staticmethod(lambda: True)
    """Asked before each write to the socket; False closes the connection with all that waits for it."""

    _take: Take | None = None
    _given_up = False
    """Whether nobody wants the connection any more, also when it comes to stand later."""

    def __init__(self, *arguments: Any, **settings: Any) -> None:  # noqa: ANN401 - aiomqtt's
        super().__init__(*arguments, **settings)
        self._unconfirmed: dict[int, Confirmed] = {}
        self._at_work = False
        """Whether paho is used now, by somebody who writes at the end what waits to be written."""
        self._waits_to_write = False
        """Whether the socket did not take all, and the event loop tells when it takes more."""
        self._reads_on = False
        """Whether more is read in the next turn of the event loop, whatever the socket says."""
        self._wrote = False
        """Whether something was written in this turn of the event loop; what follows goes at its end."""
        self._packets = Packets(self._client._sock_recv)  # noqa: SLF001 - paho has no other place for it
        self._client._sock_recv = self._packets.read  # type: ignore[method-assign] # noqa: SLF001 - the same

    async def __aenter__(self) -> Self:
        """Connect to the broker.

        Raises:
            aiomqtt.MqttError: it is not reached, or has ended the connection as soon as it stood, which
                aiomqtt forgets.

        """
        try:
            await super().__aenter__()
        except BaseException:
            self._given_up = True
            self._client.disconnect()
            raise
        if not self._client.is_connected():
            raise aiomqtt.MqttError(ENDED_AT_ONCE)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Disconnect in order if the broker takes that in :data:`FAREWELL` seconds; close in any case.

        Nothing is handed over any more.
        """
        self._take = _pass_over
        self.timeout = min(self.timeout, FAREWELL)
        try:
            with suppress(aiomqtt.MqttError):  # what has ended the block is told, not this
                await super().__aexit__(kind, error, trace)
        finally:
            self._client._sock_close()  # noqa: SLF001 - what paho does with a connection that is lost

    async def hand_over(self, take: Take) -> None:
        """Give ``take`` all messages, first those that have waited, until the connection ends.

        It is called from the event loop and must not raise.

        Raises:
            aiomqtt.MqttError: the connection has ended.

        """
        while len(self.messages):
            message = await anext(self.messages)
            take(Inbound(message.topic.value, bytes(message.payload), message.retain, message.qos))
        self._take = take
        await anext(self.messages)

    def send(self, message: Outbound, confirmed: Confirmed) -> None:
        """Publish in the order of the calls; ``confirmed`` is called when the broker has the message.

        With quality of service 0, it is called when the message is written. That is done at once, so that
        what is sent first does not wait for what the caller does next; but not while something is received,
        and what is sent behind it in the same turn of the event loop goes together, in the next one.

        Raises:
            aiomqtt.MqttError: the connection has ended.
            ValueError: nobody can be sent such a message, its topic is none.

        """
        if self._client.socket() is None:
            raise aiomqtt.MqttCodeError(MQTTErrorCode.MQTT_ERR_NO_CONN, NOT_SENT)
        at_work, self._at_work = self._at_work, True
        try:
            mid = self._put_in_line(message)
        finally:
            self._at_work = at_work
        self._unconfirmed[mid] = confirmed
        if not at_work and not self._wrote:
            self._wrote = True
            self._loop.call_soon(self._guarded, self._write_rest)
            self._guarded(self._write)

    def _put_in_line(self, message: Outbound) -> int:
        """Have a message written by paho; gives its number.

        paho need not know one with quality of service 1: the link sends again what is not acknowledged.
        """
        if message.qos != 1:
            return self._client.publish(message.topic, message.payload, message.qos, message.retain).mid
        mid = self._client._mid_generate()  # noqa: SLF001 - subscriptions are numbered in the same row
        packet = publication(message.topic, message.payload, mid, retained=message.retain)
        self._client._packet_queue(PUBLISH, packet, mid, 1)  # noqa: SLF001 - it has no other
        return mid

    def cut(self) -> None:
        """Break the connection without DISCONNECT: the broker sends the will."""
        sock = self._client.socket()
        if isinstance(sock, socket.socket):
            with suppress(OSError):  # it is broken already
                sock.shutdown(socket.SHUT_RDWR)

    def _on_disconnect(self, *arguments: Any) -> None:  # noqa: ANN401 - paho's
        if why := self._packets.why_ended:  # paho only knows that it is so
            self._tell_end(why)
        super()._on_disconnect(*arguments)
        if self._disconnected.done() and not self._disconnected.cancelled():
            self._disconnected.exception()  # asyncio logs one that nobody has looked at
        for answer in self._pending_subscribes.values():
            if not answer.done():  # aiomqtt would wait for it until its time is over
                answer.set_exception(aiomqtt.MqttError(ENDED_UNANSWERED))

    def _tell_end(self, why: str) -> None:
        """Tell those who wait that it is in vain; aiomqtt would wait for CONNACK until its time is over."""
        if not self._connected.done():
            self._connected.set_exception(aiomqtt.MqttError(f"{why} {UNGREETED}"))
            self._connected.exception()  # asyncio logs one that nobody has looked at
        elif not self._disconnected.done():
            self._disconnected.set_exception(aiomqtt.MqttError(why))

    def _on_message(self, client: PahoClient, userdata: object, message: MQTTMessage) -> None:
        if self._take is None:
            super()._on_message(client, userdata, message)
        else:  # one that only paho knows what to do with
            self._take(Inbound(message.topic, bytes(message.payload), message.retain, message.qos))

    def _on_publish(self, _client: PahoClient, _userdata: object, mid: int, *_: object) -> None:
        self._confirm(mid)

    def _confirm(self, mid: int) -> None:
        if confirmed := self._unconfirmed.pop(mid, None):
            confirmed()

    def _on_socket_open(self, _client: PahoClient, _userdata: object, sock: Any) -> None:  # noqa: ANN401 - paho's
        self._loop.call_soon_threadsafe(self._watch, sock)

    def _watch(self, sock: Any) -> None:  # noqa: ANN401 - paho's
        """Read what comes, unless the thread that was to connect has closed the socket again.

        If it was given up meanwhile, CONNECT is not written, so that it takes nobody's place at the broker.
        """
        if self._given_up:
            sock.close()  # not by paho, in which the thread may still be at work
        elif sock.fileno() >= 0:
            self._misc_task = self._loop.create_task(self._misc_loop(), name="keep alive")
            self._loop.add_reader(sock.fileno(), self._on_readable)

    def _on_socket_register_write(self, _client: PahoClient, _userdata: object, sock: Any) -> None:  # noqa: ANN401 - paho's
        if self._at_work:
            return
        if self._in_loop():
            self._loop.call_soon(self._guarded, self._write)
        else:
            self._loop.call_soon_threadsafe(self._write_later, sock)

    def _write_later(self, sock: Any) -> None:  # noqa: ANN401 - paho's
        """Write when the socket takes something, unless it was closed meanwhile."""
        if sock.fileno() >= 0:
            self._waits_to_write = True
            self._loop.add_writer(sock.fileno(), partial(self._guarded, self._write_permitted))

    def _on_socket_unregister_write(self, client: PahoClient, userdata: object, sock: Any) -> None:  # noqa: ANN401 - paho's
        if self._waits_to_write:
            self._waits_to_write = False
            super()._on_socket_unregister_write(client, userdata, sock)

    def _on_readable(self) -> None:
        if not self._reads_on:
            self._guarded(self._read)

    def _read(self) -> None:
        """Read what has come, some packets for each turn of the event loop, and write what that brings."""
        self._reads_on = False
        if not self._packets.ready and self._packets.fill():
            self._client._last_bytes_received = monotonic()  # noqa: SLF001 - else it takes a busy broker for dead
        received = []
        for _ in range(READ_AT_ONCE):
            message = self._packets.take() if self._take else None
            if message and self._take:
                self._take(Inbound(message.topic, message.payload, message.retained, message.qos))
                received.append(message)
            elif mid := self._packets.take_acknowledgement(self._unconfirmed):
                self._confirm(mid)
            elif self._packets.offer():
                self._client.loop_read()
            else:
                break
        self._acknowledge(received)
        if self._client.want_write():
            self._write()
        sock: Any = self._client.socket()
        decrypted = sock is not None and hasattr(sock, "pending") and sock.pending()
        if decrypted or (sock is not None and self._packets.ready):
            self._reads_on = True  # the socket itself may stay quiet
            self._loop.call_soon(self._guarded, self._read)

    def _acknowledge(self, received: list[Published]) -> None:
        """Tell the broker of all at once; paho would call the socket for each."""
        if mids := [each.mid for each in received if each.qos]:
            self._client._packet_queue(PUBACK, acknowledgements(mids), 0, 1)  # noqa: SLF001 - it has no other

    def _write_rest(self) -> None:
        """Write what was sent behind the first message of a turn."""
        self._wrote = False
        if self._client.want_write():
            self._write()

    def _write(self) -> None:
        """Write what waits, at once; what the socket does not take goes when it is ready again."""
        self._join_waiting()
        self._write_permitted()
        sock = self._client.socket()
        if sock is not None and self._client.want_write():
            self._write_later(sock)

    def _write_permitted(self) -> None:
        if not self.may_write():
            self._tell_end(NOT_PERMITTED)
            self.cut()
        self._client.loop_write()

    def _join_waiting(self) -> None:
        """Make one packet of messages and acknowledgements in a row: paho calls the socket for each."""
        waiting = self._client._out_packet  # noqa: SLF001 - it has no other
        if len(waiting) < 2:  # noqa: PLR2004 - there is nothing to be joined
            return
        rows = [(plain, list(row)) for plain, row in groupby(waiting, _is_plain)]
        waiting.clear()
        for plain, row in rows:
            if plain:
                packet = b"".join(each["packet"] for each in row)
                self._client._packet_queue(PUBLISH, packet, 0, 1)  # noqa: SLF001 - it has no other
            else:
                waiting.extend(row)

    def _guarded(self, work: Callable[[], object]) -> None:
        """Do ``work``; what breaks it breaks the connection: paho would stumble over it again and again."""
        self._at_work = True
        try:
            work()
        except Exception as error:  # noqa: BLE001 - whatever paho or the socket raise
            if not self._disconnected.done():
                self._disconnected.set_exception(error)
            self.cut()
            self._client.disconnect()
            self._loop.call_soon(self._guarded, self._write)  # it finds that the connection is cut
        finally:
            self._at_work = False

    def _in_loop(self) -> bool:
        try:
            return asyncio.get_running_loop() is self._loop
        except RuntimeError:
            return False


def _is_plain(packet: Any) -> bool:  # noqa: ANN401 - paho's
    """Whether paho has nothing to do with it but to write it, has not begun to, and it is worth copying."""
    to_be_written = packet["qos"] == 1 and packet["command"] in {PUBLISH, PUBACK} and not packet["pos"]
    return to_be_written and len(packet["packet"]) < CHUNK


def _pass_over(_message: Inbound) -> None:
    """Take a message that nobody wants any more."""
