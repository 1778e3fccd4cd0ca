"""A bare paho client with its own thread: the far end of measurements, and their yardstick."""

from __future__ import annotations

import json
import queue
import socket
import sys
import time
from collections.abc import Callable
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from bench.programs import wait_for_end_of_input

CONNECT_SECONDS = 10.0
STATES = "uagv/v2/+/+/state"

OnMessage = Callable[[str, bytes, float], None]
"""Topic, payload, and the moment of arrival by ``time.perf_counter``."""


class Wire:
    """One connection; ``on_message`` runs in paho's thread."""

    def __init__(
        self, port: int, name: str, topics: tuple[str, ...] = (), on_message: OnMessage | None = None
    ) -> None:
        self._subscribed: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._topics = topics
        self._on_message = on_message
        self._client = paho.Client(CallbackAPIVersion.VERSION2, client_id=name)
        self._client.on_socket_open = _send_at_once
        self._client.on_connect = self._connected
        self._client.on_subscribe = lambda *_: self._subscribed.put(None)
        self._client.on_message = self._received
        self._client.max_inflight_messages_set(1000)
        self._client.connect("127.0.0.1", port)
        self._client.loop_start()
        if topics:
            self._subscribed.get(timeout=CONNECT_SECONDS)

    def publish(self, topic: str, payload: bytes, *, retain: bool = False) -> None:
        """Publish with QoS 1, without waiting."""
        self._client.publish(topic, payload, 1, retain)

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


def _send_at_once(_client: Any, _userdata: Any, connection: Any) -> None:
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)


class Echo:
    """One message to itself over the broker: what a message costs at least."""

    def __init__(self, port: int) -> None:
        self._arrivals: queue.SimpleQueue[float] = queue.SimpleQueue()
        self._wire = Wire(
            port, "bench-echo", ("bench/echo",), lambda *message: self._arrivals.put(message[2])
        )

    def round_trip(self) -> float:
        """Return the seconds of one round trip of 2 kB."""
        start = time.perf_counter()
        self._wire.publish("bench/echo", b"x" * 2000)
        return self._arrivals.get(timeout=CONNECT_SECONDS) - start

    def close(self) -> None:
        """Disconnect."""
        self._wire.close()


def parse_states() -> None:
    """Parse the JSON of all states until the input ends: the least that a subscriber does for one."""
    wire = Wire(int(sys.argv[1]), "bench-bare", (STATES,), lambda *message: json.loads(message[1]))
    wait_for_end_of_input()
    wire.close()


if __name__ == "__main__":
    parse_states()
