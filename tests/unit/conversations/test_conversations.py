"""Recorded conversations with real agents: they are without fault, and the cores do the same again."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from nena_conversations.checker import check
from nena_conversations.message import ReceivedMessage, Sender
from nena_conversations.recording import read_file
from nena_conversations.rules import Rule
from nena_edge_agent.protocol.events import (
    ActionReport,
    InstantActionsReceived,
    OrderReceived,
    ResponsesReceived,
    Started,
    ZoneSetReceived,
)
from nena_order_service.fleet.controller import FleetController
from nena_order_service.fleet.robot import LinkStatus
from nena_order_service.fleet.settings import FleetSettings
from nena_shared.vda5050.action import ActionStatus, InstantActions
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.state import State
from nena_shared.vda5050.versions import RULES
from nena_shared.vda5050.zone_set import ZoneSetTransfer
from support.conversations import FOLDER, STORIES
from support.robot_core import ACTIONS, WORK, Bench, at
from support.talk import conversation

FILES = sorted(FOLDER.glob("*.jsonl"))
FOUND = {"refusals": [Rule.START_NODE, Rule.NOT_OFFERED]}
"""What fleet control does wrong on purpose in a story: it starts elsewhere, and asks a robot to dance."""
NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
RETRIABLE = {
    name: replace(WORK, action_type=name) for name in ("pick", "drop", "wait", "failOnce", "failAlways")
}


def test_every_story_was_recorded_in_every_version_that_has_it() -> None:
    wanted = {f"{version}-{story.__name__}" for version, stories in STORIES.items() for story in stories}

    assert {file.stem for file in FILES} == wanted


@pytest.mark.clause("6.6", "6.1.4", "6.6.2", "6.6.9")
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_nothing_is_wrong_with_it(file: Path) -> None:
    entries = list(read_file(file))

    assert len(entries) > 8
    assert [each.rule for each in check(entries)] == FOUND.get(file.stem.split("-")[1], [])


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_fleet_control_understands_the_robot(file: Path) -> None:
    fleet = FleetController(FleetSettings())
    fleet.on_broker(connected=True, now=0.0)
    messages = conversation(file)
    last: State | None = None
    for now, each in enumerate(messages):
        match each.message:
            case Connection() as message:
                fleet.on_connection(each.robot, message, float(now))
            case Factsheet() as message:
                fleet.on_factsheet(each.robot, message, float(now))
            case State() as message:
                fleet.on_state(each.robot, message, float(now))
                last = message
                assert fleet.view(each.robot, float(now)).link is LinkStatus.ONLINE

    view = fleet.view(messages[0].robot, float(len(messages)))
    assert view.state == last
    assert view.factsheet is not None
    assert view.link is LinkStatus.OFFLINE


class Replay:
    """A core that receives the messages of fleet control and acts as the robot did."""

    def __init__(self, version: str) -> None:
        self.bench = Bench(rules=RULES[version], actions=ACTIONS | RETRIABLE)
        self.bench.do(Started(NOON))

    def receive(self, received: ReceivedMessage) -> None:
        match received.message:
            case Order() as order:
                self.bench.do(OrderReceived(order))
            case InstantActions() as message:
                self.bench.do(InstantActionsReceived(message))
            case ZoneSetTransfer() as message:
                self.bench.do(ZoneSetReceived(message))
            case Responses() as message:
                self.bench.do(ResponsesReceived(message, NOON))

    def follow(self, state: State) -> None:
        """Make the driver and the plug-ins do what ``state`` reports."""
        goal = self.bench.core.robot.goal
        while self.bench.state.last_node_sequence_id < state.last_node_sequence_id:
            self.bench.arrive()
        if state.mobile_robot_position:
            self.bench.do(at(state.mobile_robot_position.x, state.mobile_robot_position.y))
        if goal.halting and not state.driving:
            self.bench.halted()
        for each in (*state.action_states, *state.instant_action_states):
            mine = self.bench.core.robot.actions.get(each.action_id)
            if mine is None or mine.action.action_type == "waitForTrigger":
                continue
            failed = each.action_status in (ActionStatus.FAILED, ActionStatus.RETRIABLE)
            if each.action_status not in (ActionStatus.WAITING, mine.status):
                self.bench.do(ActionReport(each.action_id, ActionStatus.RUNNING))
                end = ActionStatus.FAILED if failed else each.action_status
                self.bench.do(ActionReport(each.action_id, end, each.action_result))


def comparable(state: State) -> dict[str, object]:
    """Return what must be the same: all but texts, poses, and what only the driver knows."""
    shown = (*state.action_states, *state.instant_action_states)
    return {
        "order": (state.order_id, state.order_update_id),
        "last": (state.last_node_id, state.last_node_sequence_id),
        "nodes": [(each.node_id, each.sequence_id, each.released) for each in state.node_states],
        "edges": [(each.edge_id, each.sequence_id, each.released) for each in state.edge_states],
        "actions": {each.action_id: each.action_status for each in shown},
        "errors": len(state.errors),
        "paused": state.paused or False,
        "zones": [each.zone_set_status for each in state.zone_sets or ()],
    }


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_replay_to_the_robot_core_gives_the_same_messages(file: Path) -> None:
    messages = conversation(file)
    replay = Replay(messages[0].codec.version)
    compared = 0
    for each, following in zip(messages, [*messages[1:], None], strict=True):
        if each.sender is Sender.FLEET:
            replay.receive(each)
            continue
        if isinstance(each.message, State):
            replay.follow(each.message)
            if following is None or following.sender is Sender.ROBOT:
                assert comparable(replay.bench.state) == comparable(each.message), each.number
                compared += 1
    assert compared
