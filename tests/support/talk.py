"""VDA 5050 conversations for tests of the checker, built message by message."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Self

from nena_conversations.checker import check
from nena_conversations.message import ReceivedMessage, parse
from nena_conversations.recording import Entry, read_file
from nena_conversations.rules import Finding, Rule
from nena_shared.vda5050.action import Action, ActionState, ActionStatus, InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.state import State
from nena_shared.vda5050.versions import codec_for
from support.fleet_examples import state as example_state
from support.robot_core import order

START = datetime(2026, 1, 1, tzinfo=UTC)
TOPICS: dict[type[Header], str] = {
    Order: "order",
    InstantActions: "instantActions",
    Responses: "responses",
    State: "state",
    Connection: "connection",
    Factsheet: "factsheet",
}
HEADER = example_state().model_dump(include=set(Header.model_fields))


class Talk:
    """A conversation under construction, with a second between messages."""

    def __init__(self, version: str = "3.0.0") -> None:
        self.version = version
        self.codec = codec_for(version)
        self.entries: list[Entry] = []
        self.now = START
        self._numbers: dict[str, int] = {}

    def say(self, message: Header, **header: Any) -> Self:
        topic = TOPICS[type(message)]
        number = self._numbers[topic] = self._numbers.get(topic, -1) + 1
        self.now += timedelta(seconds=1)
        fields = {"header_id": number, "timestamp": self.now, "manufacturer": "ACME", "serial_number": "0001"}
        payload = self.codec.encode(message.model_copy(update=fields | header))
        return self.raw(f"fleet/{self.codec.major_version}/ACME/0001/{topic}", payload)

    def raw(self, topic: str, payload: bytes) -> Self:
        self.entries.append(Entry(self.now, topic, payload))
        return self

    def order(self, *nodes: str, **fields: Any) -> Self:
        return self.say(order(*nodes, **fields))

    def act(self, *actions: Action) -> Self:
        return self.say(InstantActions(**HEADER, actions=actions))

    def state(self, last: str = "n0", *left: str, of: str = "o1", update: int = 0, **fields: Any) -> Self:
        """Report a state at the node ``last``, with the nodes ``left`` to drive."""
        number = int(last[1:]) * 2 if last else 0
        nodes = tuple({"node_id": each, "sequence_id": int(each[1:]) * 2, "released": True} for each in left)
        content = {
            "order_id": of,
            "order_update_id": update,
            "last_node_id": last,
            "last_node_sequence_id": number,
            "node_states": nodes,
            **fields,
        }
        return self.say(example_state(**content))

    def online(self, state: str = "ONLINE") -> Self:
        return self.say(Connection(**HEADER, connection_state=ConnectionState(state)))

    def wait(self, seconds: float) -> Self:
        self.now += timedelta(seconds=seconds)
        return self

    @property
    def findings(self) -> list[Finding]:
        return list(check(self.entries))

    @property
    def texts(self) -> str:
        return "; ".join(each.text for each in self.findings)

    @property
    def rules(self) -> list[Rule]:
        return [each.rule for each in self.findings]


def doing(*statuses: tuple[str, str]) -> tuple[ActionState, ...]:
    return tuple(
        ActionState(action_id=action_id, action_type="work", action_status=ActionStatus(status))
        for action_id, status in statuses
    )


def conversation(file: Path) -> list[ReceivedMessage]:
    """Return the readable messages of a recording."""
    messages = (parse(entry, number) for number, entry in enumerate(read_file(file), start=1))
    return [each for each in messages if each]
