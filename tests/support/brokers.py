"""Real RabbitMQ and NATS servers for tests, on free loopback ports, beside Mosquitto (support.broker)."""

from __future__ import annotations

import base64
import getpass
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
    def version(self) -> str:
        """Version of the package."""
        query = ["dpkg-query", "--show", "--showformat=${Version}", self.package]
        return subprocess.run(query, capture_output=True, text=True, check=False).stdout or "unknown"

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
                probe.sendall(self._connect_packet())
                return probe.recv(len(ACCEPTED)) == ACCEPTED
        except OSError:
            return False

    def _connect_packet(self) -> bytes:
        """Return a CONNECT packet of MQTT 3.1.1 of a client `probe`."""
        login = [each.encode() for each in (self.username, self.password) if each]
        flags = b"\xc2" if login else b"\x02"
        head = b"\x00\x04MQTT\x04" + flags + b"\x00\x0a"
        body = head + b"".join(len(each).to_bytes(2) + each for each in (b"probe", *login))
        return b"\x10" + bytes([len(body)]) + body

    def _listens(self, port: int) -> bool:
        with socket.socket() as probe:
            return probe.connect_ex((self.host, port)) == 0


class Mosquitto(RealBroker):
    """A Mosquitto that keeps retained messages and sessions over a restart, as Debian's does."""

    package = "mosquitto"

    def _configure(self, more: str) -> None:
        (self._folder / "mosquitto.conf").write_text(f"""\
listener {self.port} 127.0.0.1
allow_anonymous true
user {getpass.getuser()}
persistence true
persistence_location {self._folder}/
{more}
""")

    def _command(self) -> tuple[str, ...]:
        return str(self._program), "-c", str(self._folder / "mosquitto.conf")


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


class ErlangBroker(RealBroker):
    """A broker in Erlang, with a port mapper of its own."""

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

    def _environment(self) -> dict[str, str]:
        return {"ERL_EPMD_PORT": str(self._mapper_port), "ERL_EPMD_ADDRESS": "127.0.0.1"}


class RabbitMq(ErlangBroker):
    """A RabbitMQ with the plugin rabbitmq_mqtt."""

    package = "rabbitmq-server"

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
        return super()._environment() | {
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


class Ejabberd(ErlangBroker):
    """An ejabberd with mod_mqtt, which admits registered users only."""

    package = "ejabberd"
    username = "nena@localhost"
    password = "nena"

    def _installed(self) -> Path:
        found = sorted(Path("/usr/lib").glob("*/ejabberd-*/ebin/ejabberd.app"))
        if not found:
            pytest.skip("ejabberd is not on this machine: apt-get install ejabberd")
        return found[-1].parents[2]

    def _configure(self, more: str) -> None:
        (self._folder / "ejabberd.yml").write_text(f"""\
hosts: [localhost]
loglevel: warning
auth_method: internal
listen:
  - {{port: {self.port}, ip: "127.0.0.1", module: mod_mqtt}}
modules:
  mod_mqtt: {{}}
{more}
""")

    def _command(self) -> tuple[str, ...]:
        # Not ejabberdctl, which changes to the user ejabberd.
        register = 'ejabberd_auth:try_register(<<"nena">>, <<"localhost">>, <<"nena">>)'
        begin = f"{{ok, _}} = application:ensure_all_started(ejabberd), {register}."
        kernel = ("-kernel", "inet_dist_use_interface", "{127,0,0,1}")
        idle = ("+S", "2:2", "+sbwt", "none")
        name = ("-sname", f"nena-test-{self.port}@localhost")
        store = ("-mnesia", "dir", f'"{self._folder}/db"')
        return ("erl", *name, "-noinput", *idle, *kernel, *store, "-eval", begin)

    def _environment(self) -> dict[str, str]:
        return super()._environment() | {
            "ERL_LIBS": str(self._program),
            "EJABBERD_CONFIG_PATH": str(self._folder / "ejabberd.yml"),
            "EJABBERD_LOG_PATH": str(self._folder / "ejabberd.log"),
        }


CODEC = Path("/usr/share/java/mqtt-client.jar")
SPRING = "http://www.springframework.org/schema/beans"
ACTIVEMQ = "http://activemq.apache.org/schema/core"


class ActiveMq(RealBroker):
    """An ActiveMQ Classic with the MQTT codec that Debian has in a package of its own."""

    package = "activemq"

    def _installed(self) -> Path:
        program = Path("/usr/share/activemq/bin/activemq.jar")
        if not (program.exists() and CODEC.exists()):
            pytest.skip(
                "ActiveMQ with MQTT is not on this machine: apt-get install activemq libmqtt-client-java"
            )
        return program

    def _configure(self, more: str) -> None:
        (self._folder / "codec").mkdir()
        (self._folder / "codec" / CODEC.name).symlink_to(CODEC)
        (self._folder / "activemq.xml").write_text(f"""\
<beans xmlns="{SPRING}" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance"
    xsi:schemaLocation="{SPRING} {SPRING}/spring-beans.xsd {ACTIVEMQ} {ACTIVEMQ}/activemq-core.xsd">
  <broker xmlns="{ACTIVEMQ}" brokerName="nena-test-{self.port}" useJmx="false">
    <persistenceAdapter><kahaDB directory="{self._folder}/kahadb"/></persistenceAdapter>
    <transportConnectors>
      <transportConnector name="mqtt" uri="mqtt://127.0.0.1:{self.port}"/>
    </transportConnectors>
    {more}
  </broker>
</beans>
""")

    def _command(self) -> tuple[str, ...]:
        folders = {"home": "/usr/share/activemq", "base": self._folder, "data": self._folder / "data"}
        options = [f"-Dactivemq.{name}={folder}" for name, folder in folders.items()]
        begin = ("start", "--extdir", f"{self._folder}/codec", f"xbean:file:{self._folder}/activemq.xml")
        return ("java", "-Xmx256M", *options, "-jar", str(self._program), *begin)


class Aedes(RealBroker):
    """An Aedes of npm, which keeps all in memory; ``make brokers-more`` installs it."""

    package = "aedes"

    @property
    def version(self) -> str:
        """Version of the package."""
        return str(json.loads((self._program / "aedes" / "package.json").read_text())["version"])

    def _installed(self) -> Path:
        modules = Path(".venv/aedes/node_modules").absolute()
        if not (modules / "aedes").exists() or not shutil.which("node"):
            pytest.skip("Aedes is not on this machine: make brokers-more")
        return modules

    def _configure(self, more: str) -> None:
        (self._folder / "node_modules").symlink_to(self._program)
        (self._folder / "server.mjs").write_text(f"""\
import {{ createServer }} from "node:net";
import {{ Aedes }} from "aedes";
const aedes = await Aedes.createBroker({{ {more} }});
createServer(aedes.handle).listen({self.port}, "127.0.0.1");
""")

    def _command(self) -> tuple[str, ...]:
        return "node", "server.mjs"


BROKERS: dict[str, type[RealBroker]] = {
    "Mosquitto": Mosquitto,
    "RabbitMQ": RabbitMq,
    "NATS": Nats,
    "ejabberd": Ejabberd,
    "ActiveMQ": ActiveMq,
    "Aedes": Aedes,
}
"""Each broker by its name."""
