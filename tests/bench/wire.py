"""A bare paho client with a reader thread, as the yardstick and as the far end of measurements."""

from __future__ import annotations

import queue
import socket
import time
from collections.abc import Callable
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

CONNECT_SECONDS = 10.0

OnMessage = Callable[[str, bytes, float], None]
"""Topic, payload, and the moment of arrival by ``time.perf_counter``."""


class Wire:
    """One connection; ``on_message`` runs in paho's thread."""

    def __init__(
        self, port: int, name: str, topics: tuple[str, ...], on_message: OnMessage | None = None
    ) -> None:
        self._ready: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._topics = topics
        self._on_message = on_message
        self._client = paho.Client(CallbackAPIVersion.VERSION2, client_id=name)
        self._client.on_socket_open = _no_delay
        self._client.on_connect = self._connected
        self._client.on_subscribe = lambda *_: self._ready.put(None)
        self._client.on_message = self._received
        self._client.max_inflight_messages_set(1000)
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()
        if topics:
            self._ready.get(timeout=CONNECT_SECONDS)

    def publish(self, topic: str, payload: bytes, *, qos: int = 1, retain: bool = False) -> None:
        """Publish without waiting."""
        self._client.publish(topic, payload, qos, retain)

    def close(self) -> None:
        """Disconnect and end the thread."""
        self._client.disconnect()
        self._client.loop_stop()

    def _connected(self, client: paho.Client, *_: object) -> None:
        if self._topics:
            client.subscribe([(topic, 1) for topic in self._topics])

    def _received(self, _client: paho.Client, _userdata: object, message: paho.MQTTMessage) -> None:
        if self._on_message:
            self._on_message(message.topic, bytes(message.payload), time.perf_counter())


def _no_delay(_client: Any, _userdata: Any, connection: Any) -> None:
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
