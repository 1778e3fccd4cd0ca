"""The control door: commands by MQTT to the loopback robots of this program, and an answer to each."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from nena_edge_agent.loopback.bench import Bench
from nena_edge_agent.loopback.commands import CommandRefusedError, parse
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.settings import MqttSettings
from nena_shared.vda5050.topics import RobotKey

log = get_logger(__name__)

LONGEST = 10_000
"""Bytes of a command."""


class ControlDoor:
    """One for all robots of the program, on a link of its own: a robot whose link is cut hears it still.

    A command stands under ``<interface name>/loopback/<manufacturer>/<serial number>/control``, its answer
    under ``.../answer``. Robots that are not of this program are another program's matter.
    """

    def __init__(
        self, settings: MqttSettings, interface_name: str, benches: Mapping[RobotKey, Bench]
    ) -> None:
        self._benches = {f"{interface_name}/loopback/{robot}": bench for robot, bench in benches.items()}
        first = next(iter(benches))
        self._link = MqttLink(
            settings.model_copy(update={"client_id": None}),  # that one is the robot's own
            client_id=f"nena-loopback-control-{first.manufacturer}-{first.serial_number}",
        )
        topic_filter = f"{interface_name}/loopback/{first.manufacturer}/+/control"
        self._link.subscribe(topic_filter, self._take)
        log.info("control door open", topic=topic_filter)

    async def run(self) -> None:
        """Answer until cancelled."""
        await self._link.run()

    def _take(self, message: Inbound) -> None:
        place = message.topic.removesuffix("/control")
        bench = self._benches.get(place)
        if bench is None or not message.payload:
            return
        problems = _obey(bench, message)
        log.info("control command", topic=message.topic, accepted=not problems, problems=problems)
        self._link.publish(Outbound(f"{place}/answer", _answer(message.payload, problems), keep=False))


def _obey(bench: Bench, message: Inbound) -> tuple[str, ...]:
    """Obey the command; gives what keeps it from being obeyed."""
    if message.retained:
        return ("a retained command may be old and is not obeyed; send it without the retain flag",)
    if len(message.payload) > LONGEST:
        return (f"a command has at most {LONGEST} bytes",)
    try:
        bench.apply(parse(message.payload))
    except CommandRefusedError as refused:
        return refused.problems
    return ()


def _answer(payload: bytes, problems: tuple[str, ...]) -> bytes:
    """Make the answer, with what can be read of the command."""
    answer: dict[str, Any] = {"accepted": not problems}
    if problems:
        answer["problems"] = problems
    return json.dumps(_named(payload) | answer).encode()


def _named(payload: bytes) -> dict[str, str]:
    """Give id and name of a command, as far as it has them."""
    try:
        command = json.loads(payload[:LONGEST])
    except (ValueError, RecursionError):
        return {}
    if not isinstance(command, dict):
        return {}
    return {key: value for key in ("id", "command") if isinstance(value := command.get(key), str)}
