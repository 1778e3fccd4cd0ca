"""A real Mosquitto for tests, on a free loopback port, and a client that records what it delivers."""

from __future__ import annotations

import contextlib
import getpass
import itertools
import os
import secrets
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, Self

import pytest
from paho.mqtt.client import Client, MQTTMessage, topic_matches_sub
from paho.mqtt.enums import CallbackAPIVersion
from pydantic import SecretStr

from nena_shared.mqtt import Inbound
from nena_shared.settings import MqttSettings
from support.waiting import PATIENCE, until, wait_until

CONFIGURATION = """\
listener {port} 127.0.0.1
allow_anonymous {anonymous}
user {user}
persistence false
set_tcp_nodelay true
max_queued_messages 20000
max_inflight_messages 200
log_dest file {folder}/mosquitto.log
log_type all
"""

CONNECTED_WITHIN = PATIENCE
"""Timeout for broker and clients to be ready, seconds."""

_client_numbers = itertools.count()


PORTS = range(15_000, 32_000)
"""Ports that the system does not assign to clients between the choice of a port and its use."""


def free_port() -> int:
    """Return an unused TCP port of 127.0.0.1."""
    while True:
        port = secrets.choice(PORTS)
        with socket.socket() as probe, suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


def mosquitto() -> str:
    """Return the path of Mosquitto; if it is not installed, the test fails with instructions."""
    path = shutil.which("mosquitto", path=f"{os.environ.get('PATH', '')}:/usr/sbin:/usr/local/sbin")
    if path is None:
        pytest.fail("these tests need a real MQTT broker: apt-get install mosquitto", pytrace=False)
    return path


class BrokerAddress:
    """Address of a broker."""

    host = "127.0.0.1"
    username: str | None = None
    password: str | None = None

    def __init__(self, port: int | None = None) -> None:
        self.port = port or free_port()

    @property
    def settings(self) -> MqttSettings:
        """Settings of a link to this broker, with quick reconnects."""
        return MqttSettings(
            host=self.host,
            port=self.port,
            username=self.username,
            password=SecretStr(self.password) if self.password else None,
            reconnect_min=0.02,
            reconnect_max=0.1,
        )

    @property
    def options(self) -> list[str]:
        """Options of a program that connects to this broker."""
        named = {"host": self.host, "port": self.port, "username": self.username, "password": self.password}
        return [f"--mqtt.{name}={value}" for name, value in named.items() if value is not None]


class Broker(BrokerAddress):
    """A Mosquitto process; keeps its port over :meth:`restart`, forgets everything else.

    With ``users`` (name to password) it admits only these; ``more`` is added to its configuration. It listens
    on ``addresses`` of this machine as well.
    """

    def __init__(
        self,
        *,
        users: dict[str, str] | None = None,
        more: str = "",
        addresses: Sequence[str] = (),
        port: int | None = None,
    ) -> None:
        super().__init__(port)
        self._users = users or {}
        self._more = more
        self._addresses = addresses
        self._folder = Path(tempfile.mkdtemp(prefix="nena-test-broker-"))
        self._process: subprocess.Popen[bytes] | None = None
        self._configure()
        self.start()

    @property
    def pid(self) -> int:
        """Process ID."""
        return self._running.pid

    @property
    def log(self) -> str:
        """The broker's log."""
        file = self._folder / "mosquitto.log"
        return file.read_text(encoding="utf-8") if file.exists() else ""

    def start(self) -> None:
        """Start the process and wait until it accepts connections."""
        self._process = subprocess.Popen(
            [mosquitto(), "-c", str(self._folder / "mosquitto.conf")],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        wait_until(self._listens, timeout=CONNECTED_WITHIN, what=f"mosquitto on port {self.port}")

    def kill(self) -> None:
        """Kill the process, as a power failure would."""
        self._signal(signal.SIGKILL)
        self._running.wait()

    def restart(self) -> None:
        """Restart the process on the same port, without retained messages."""
        if self._running.poll() is None:
            self.kill()
        self.start()

    def freeze(self) -> None:
        """Suspend the process: connections stay open, nothing is answered."""
        self._signal(signal.SIGSTOP)

    def thaw(self) -> None:
        """End :meth:`freeze`."""
        self._signal(signal.SIGCONT)

    def close(self) -> None:
        """End the process and remove its files."""
        if self._running.poll() is None:
            self.kill()
        shutil.rmtree(self._folder, ignore_errors=True)

    @property
    def _running(self) -> subprocess.Popen[bytes]:
        assert self._process is not None
        return self._process

    def _signal(self, number: signal.Signals) -> None:
        self._running.send_signal(number)

    def _listens(self) -> bool:
        assert self._running.poll() is None, f"mosquitto has ended:\n{self.log}"
        return self._accepts()

    def _accepts(self) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex((self.host, self.port)) == 0

    def _configure(self) -> None:
        text = CONFIGURATION.format(
            port=self.port,
            folder=self._folder,
            user=getpass.getuser(),
            anonymous="false" if self._users else "true",
        )
        if self._users:
            passwords = self._folder / "passwords"
            passwords.write_text("".join(f"{name}:{word}\n" for name, word in self._users.items()))
            subprocess.run(["mosquitto_passwd", "-U", str(passwords)], check=True, timeout=PATIENCE)
            text += f"password_file {passwords}\n"
        more = "".join(f"listener {self.port} {each}\n" for each in self._addresses)
        (self._folder / "mosquitto.conf").write_text(text + more + self._more)


MOUNT_POINT = "hall-1/"
"""A Mosquitto 2.0.11 with this ``mount_point`` leaves it in front of the topics that it delivers."""


_matches = lru_cache(maxsize=10_000)(topic_matches_sub)
"""Tests look through the same topics again and again."""


CATCH_UP = "catch-up/"
"""Below here a peer writes to itself; no peer records it."""


class MqttPeer:
    """A plain MQTT client for tests, in its own thread: publishes, and records by topic.

    Use it as a context manager: ``with MqttPeer(broker, "robots/#") as peer: ...``. It is subscribed when the
    block begins.
    """

    def __init__(
        self,
        broker: BrokerAddress,
        *topic_filters: str,
        on_message: Callable[[Inbound], None] = lambda _: None,
        on_connected: Callable[[], object] = lambda: None,
    ) -> None:
        self._on_message, self._on_connected = on_message, on_connected
        """Called in the thread of the client."""
        self._order: list[Inbound] = []
        self.history: list[Inbound] = []
        """All received messages, including cleared ones."""
        self._lock = threading.Lock()
        self._subscribed = threading.Event()
        self._topic_filters = topic_filters
        client_id = f"peer-{next(_client_numbers)}-{os.getpid()}"
        self._own_topic = f"{CATCH_UP}{client_id}"
        self._caught_up = threading.Event()
        self._client = Client(CallbackAPIVersion.VERSION2, client_id=client_id)
        self._client.on_socket_open = self._no_delay
        self._client.on_connect = self._subscribe
        self._client.on_subscribe = lambda *_: self._subscribed.set()
        self._client.on_message = self._record
        self._client.username_pw_set(broker.username, broker.password)
        self._client.connect(broker.host, broker.port, keepalive=30)

    def __enter__(self) -> Self:
        self._client.loop_start()
        assert self._subscribed.wait(CONNECTED_WITHIN), "the test's MQTT client was not let in"
        return self

    def __exit__(self, *_: object) -> None:
        self._client.disconnect()
        # paho's thread may end between loop_stop's check and its join.
        with contextlib.suppress(AttributeError):
            self._client.loop_stop()

    def publish(self, topic: str, payload: bytes | str, *, qos: int = 1, retain: bool = False) -> None:
        """Publish and wait until the message is sent."""
        self._client.publish(topic, payload, qos, retain).wait_for_publish(CONNECTED_WITHIN)

    def send(self, topic: str, payload: bytes | str, *, retain: bool = False) -> None:
        """Publish without waiting, from any thread."""
        self._client.publish(topic, payload, 1, retain)

    def catch_up(self) -> None:
        """Wait until everything that the broker has had so far is recorded.

        Another client of the broker may have a message, and act on it, before this one has it.
        """
        self._caught_up.clear()
        self.publish(self._own_topic, b"")
        assert self._caught_up.wait(PATIENCE), "the broker delivered nothing"

    def received(self, topic_filter: str = "#") -> list[Inbound]:
        """Return the messages received under ``topic_filter``, in order."""
        with self._lock:
            return [each for each in self._order if _matches(topic_filter, each.topic)]

    def payloads(self, topic_filter: str = "#") -> list[bytes]:
        """Return the payloads received under ``topic_filter``, in order."""
        return [each.payload for each in self.received(topic_filter)]

    def clear(self) -> None:
        """Clear the recorded messages."""
        with self._lock:
            self._order.clear()

    async def wait_for(
        self,
        topic_filter: str = "#",
        accept: Callable[[Inbound], bool] = lambda _: True,
        *,
        timeout: float = PATIENCE,  # noqa: ASYNC109 - the bound is the point
    ) -> Inbound:
        """Return the first message under ``topic_filter``, also an earlier one, that ``accept`` matches."""
        return await until(
            lambda: next((each for each in self.received(topic_filter) if accept(each)), None),
            timeout=timeout,
            what=f"a message under {topic_filter}",
        )

    def _no_delay(self, _client: Client, _userdata: Any, sock: Any) -> None:
        sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def _subscribe(self, client: Client, *_: Any) -> None:
        if self._topic_filters:
            client.subscribe([(each, 1) for each in (*self._topic_filters, self._own_topic)])
        else:
            self._subscribed.set()
        self._on_connected()

    def _record(self, _client: Client, _userdata: Any, message: MQTTMessage) -> None:
        if message.topic.startswith(CATCH_UP):
            if message.topic == self._own_topic:
                self._caught_up.set()
            return
        inbound = Inbound(message.topic, bytes(message.payload), message.retain)
        with self._lock:
            self._order.append(inbound)
            self.history.append(inbound)
        self._on_message(inbound)
