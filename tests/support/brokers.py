"""Real RabbitMQ and NATS servers for tests, on free loopback ports, beside Mosquitto (support.broker)."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import shutil
import signal
import socket
import subprocess
import tempfile
from abc import ABC, abstractmethod
from contextlib import suppress
from pathlib import Path
from typing import ClassVar, Self

import pytest

from support.broker import BrokerAddress, free_port
from support.waiting import PATIENCE, STARTUP, wait_until

PATH = f"{os.environ.get('PATH', '')}:/usr/sbin:/usr/local/sbin"
CONNECT = b"\x10\x11\x00\x04MQTT\x04\x02\x00\x0a\x00\x05probe"
"""A CONNECT packet of MQTT 3.1.1 of a client `probe`."""
ACCEPTED = b"\x20\x02\x00\x00"
"""CONNACK, accepted."""
ANSWER_WITHIN = 2.0
"""Timeout of one probe, seconds."""


class RealBroker(BrokerAddress, ABC):
    """A broker process with its files in a temporary folder; keeps its port and files over :meth:`restart`.

    Use it as a context manager. ``more`` is added to its configuration. The test is skipped where the program
    is not installed.
    """

    package: ClassVar[str]
    """The Debian package."""

    def __init__(self, *, more: str = "") -> None:
        super().__init__()
        self._program = self._installed()
        self._folder = Path(tempfile.mkdtemp(prefix=f"nena-test-{self.package}-"))
        self._process: subprocess.Popen[bytes] | None = None
        self._configure(more)

    def __enter__(self) -> Self:
        try:
            self.start()
        except BaseException:
            self.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def log(self) -> str:
        """What the broker has written."""
        file = self._folder / "output"
        return file.read_text(encoding="utf-8", errors="replace") if file.exists() else ""

    def start(self) -> None:
        """Start the process and wait until it answers CONNECT."""
        self._process = self._run(*self._command())
        wait_until(self._answers, timeout=STARTUP, what=f"{self.package} on port {self.port}", every=0.1)

    def stop(self) -> None:
        """End the process as its service manager does."""
        self._signal(signal.SIGTERM)
        self._wait()

    def kill(self) -> None:
        """Kill the process, as a power failure would."""
        self._signal(signal.SIGKILL)
        self._wait()

    def restart(self) -> None:
        """Stop the process and start it on the same port."""
        self.stop()
        self.start()

    def close(self) -> None:
        """End all processes and remove the files."""
        self.kill()
        shutil.rmtree(self._folder, ignore_errors=True)

    def _installed(self) -> Path:
        path = shutil.which(self.package, path=PATH)
        if path is None:
            pytest.skip(f"{self.package} is not on this machine: apt-get install {self.package}")
        return Path(path)

    @abstractmethod
    def _configure(self, more: str) -> None:
        """Write the broker's files into its folder."""

    @abstractmethod
    def _command(self) -> tuple[str, ...]:
        """Return the command that starts it."""

    def _environment(self) -> dict[str, str]:
        return {}

    def _run(self, *command: str) -> subprocess.Popen[bytes]:
        """Start a program in a process group of its own, which its children belong to."""
        with (self._folder / "output").open("ab") as output:
            return subprocess.Popen(
                command,
                cwd=self._folder,
                env=os.environ | {"HOME": str(self._folder)} | self._environment(),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )

    def _signal(self, number: signal.Signals) -> None:
        if self._process:
            with suppress(ProcessLookupError):
                os.killpg(self._process.pid, number)

    def _wait(self) -> None:
        if self._process:
            self._process.wait(PATIENCE)
            wait_until(lambda: not self._listens(self.port), what=f"the end of {self.package}", every=0.02)

    def _answers(self) -> bool:
        assert self._process
        assert self._process.poll() is None, f"{self.package} has ended:\n{self.log}"
        try:
            with socket.create_connection((self.host, self.port), timeout=ANSWER_WITHIN) as probe:
                probe.sendall(CONNECT)
                return probe.recv(len(ACCEPTED)) == ACCEPTED
        except OSError:
            return False

    def _listens(self, port: int) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex((self.host, port)) == 0


class Nats(RealBroker):
    """A NATS server with JetStream, in which it keeps sessions and retained messages."""

    package = "nats-server"

    def _configure(self, more: str) -> None:
        (self._folder / "nats.conf").write_text(f"""\
server_name: nena-test-{self.port}
listen: "127.0.0.1:-1"
jetstream {{ store_dir: "{self._folder}/jetstream" }}
mqtt {{ listen: "127.0.0.1:{self.port}" }}
{more}
""")

    def _command(self) -> tuple[str, ...]:
        return str(self._program), "-c", str(self._folder / "nats.conf")


REFUSED = "refused"
"""Below this first level, :class:`RabbitMq` refuses all publications and subscriptions."""
UNDELIVERABLE = "undeliverable"
"""Serial number of a robot whose orders :class:`RabbitMq` refuses."""


def _password_hash(password: str) -> str:
    salt = b"salt"
    return base64.b64encode(salt + hashlib.sha256(salt + password.encode()).digest()).decode()


DEFINITIONS = {
    "vhosts": [{"name": "/"}],
    "users": [
        {
            "name": "guest",
            "password_hash": _password_hash("guest"),
            "hashing_algorithm": "rabbit_password_hashing_sha256",
            "tags": [],
        }
    ],
    "permissions": [{"user": "guest", "vhost": "/", "configure": ".*", "write": ".*", "read": ".*"}],
    "topic_permissions": [
        {
            "user": "guest",
            "vhost": "/",
            "exchange": "amq.topic",
            "write": rf"^(?!{REFUSED}\.|.*\.{UNDELIVERABLE}\.order$)",
            "read": rf"^(?!{REFUSED}\.)",
        }
    ],
}
"""The access list of anonymous clients, who are the user `guest`."""


class RabbitMq(RealBroker):
    """A RabbitMQ with the plugin rabbitmq_mqtt and an Erlang port mapper of its own."""

    package = "rabbitmq-server"

    def __init__(self, *, more: str = "") -> None:
        self._mapper: subprocess.Popen[bytes] | None = None
        self._mapper_port = free_port()
        super().__init__(more=more)

    def start(self) -> None:
        """Start the process and wait until it answers CONNECT."""
        if self._mapper is None:  # the one that a node starts for itself would outlive it
            self._mapper = self._run("epmd", "-address", "127.0.0.1", "-port", str(self._mapper_port))
            wait_until(lambda: self._listens(self._mapper_port), what=f"epmd on port {self._mapper_port}")
        super().start()

    def close(self) -> None:
        """End all processes and remove the files."""
        if self._mapper:
            self._mapper.kill()
            self._mapper.wait(PATIENCE)
        super().close()

    def _installed(self) -> Path:
        super()._installed()
        # Not the one on the PATH, which only root and the user rabbitmq may run, in its own folder.
        program = Path("/usr/lib/rabbitmq/bin/rabbitmq-server")
        if not program.exists():
            pytest.skip(f"{program} of Debian's {self.package} is not on this machine")
        return program

    def _configure(self, more: str) -> None:
        cookie = self._folder / ".erlang.cookie"
        cookie.write_text("nena-test")
        cookie.chmod(0o400)
        (self._folder / "definitions.json").write_text(json.dumps(DEFINITIONS))
        (self._folder / "enabled_plugins").write_text("[rabbitmq_mqtt].\n")
        (self._folder / "rabbitmq.conf").write_text(f"""\
listeners.tcp = none
mqtt.listeners.tcp.default = 127.0.0.1:{self.port}
load_definitions = {self._folder}/definitions.json
{more}
""")

    def _command(self) -> tuple[str, ...]:
        return (str(self._program),)

    def _environment(self) -> dict[str, str]:
        return {
            "ERL_EPMD_PORT": str(self._mapper_port),
            "ERL_EPMD_ADDRESS": "127.0.0.1",
            "RABBITMQ_NODENAME": f"nena-test-{self.port}@localhost",
            "RABBITMQ_DIST_PORT": str(free_port()),
            "RABBITMQ_BASE": str(self._folder),
            "RABBITMQ_CONF_ENV_FILE": str(self._folder / "rabbitmq-env.conf"),
            "RABBITMQ_CONFIG_FILE": str(self._folder / "rabbitmq.conf"),
            "RABBITMQ_ENABLED_PLUGINS_FILE": str(self._folder / "enabled_plugins"),
            "RABBITMQ_MNESIA_BASE": str(self._folder / "mnesia"),
            "RABBITMQ_LOG_BASE": str(self._folder / "log"),
            "RABBITMQ_LOGS": "-",
            "RABBITMQ_PID_FILE": str(self._folder / "pid"),
            # Its idle threads would take the CPU that tests need.
            "RABBITMQ_SERVER_ADDITIONAL_ERL_ARGS": "+S 2:2 +sbwt none "
            "-kernel inet_dist_use_interface {127,0,0,1}",
        }
