"""The demo's MQTT broker: Mosquitto where it is on the machine, else amqtt, a broker in Python."""

from __future__ import annotations

import asyncio
import getpass
import shutil
from pathlib import Path

from nena_demo.processes import Child, Processes, console_script

START_SECONDS = 15.0

MOSQUITTO_CONFIGURATION = """\
listener {port} 127.0.0.1
allow_anonymous true
# a change of user would undo that it ends with the demo
user {user}
persistence false
# without it, small messages wait up to 44 ms for each other
set_tcp_nodelay true
# limits on purpose: a client that falls behind loses the oldest instead of filling the memory
max_queued_messages 10000
max_inflight_messages 200
max_packet_size 8388608
log_type error
log_type warning
log_type notice
"""

AMQTT_CONFIGURATION = """\
listeners:
  default:
    type: tcp
    bind: 127.0.0.1:{port}
plugins:
  amqtt.plugins.authentication.AnonymousAuthPlugin:
    allow_anonymous: true
"""

AMQTT_NOTICE = (
    "No Mosquitto on this machine: the demo uses amqtt, a broker in Python. It notices a dead robot only "
    "when its socket closes, and keeps no sessions. For more than a look: apt-get install mosquitto"
)


def mosquitto_path() -> str | None:
    """Find Mosquitto, also where Debian puts it, which is not on every user's path."""
    return shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")


async def start_broker(processes: Processes, port: int, kind: str) -> Child:
    """Start a broker on loopback and wait until it answers.

    ``kind`` is ``auto``, ``mosquitto`` or ``amqtt``.

    Raises:
        ChildFailedError: it did not start.

    """
    mosquitto = mosquitto_path() if kind in ("auto", "mosquitto") else None
    if mosquitto:
        command = [
            mosquitto,
            "-c",
            str(_write(processes.folder / "mosquitto.conf", MOSQUITTO_CONFIGURATION, port)),
        ]
    else:
        configuration = _write(processes.folder / "amqtt.yaml", AMQTT_CONFIGURATION, port)
        command = [console_script("amqtt"), "-c", str(configuration)]
    child = await processes.start("broker", command)
    await _wait_for_port(child, port)
    return child


def _write(path: Path, template: str, port: int) -> Path:
    path.write_text(template.format(port=port, user=getpass.getuser()), encoding="utf-8")
    return path


async def _wait_for_port(child: Child, port: int) -> None:
    async with asyncio.timeout(START_SECONDS):
        while True:
            child.check()
            try:
                _, writer = await asyncio.open_connection("127.0.0.1", port)
            except OSError:
                await asyncio.sleep(0.05)
            else:
                writer.close()
                await writer.wait_closed()
                return
