"""The checker and the robot's core against each other, over random histories with wild fleet controls.

They share the message models and nothing else: the core's messages never violate the standard.
"""

from __future__ import annotations

from typing import Any, ClassVar

import pytest
from hypothesis import settings
from hypothesis.stateful import run_state_machine_as_test

from nena_conversations.message import SENDERS, Sender
from nena_conversations.rules import Severity
from nena_edge_agent.protocol.events import Effect, Event, InstantActionsReceived, OrderReceived
from nena_shared.vda5050.versions import CODECS
from support.examples import EXAMPLES
from support.robot_core import Bench
from support.talk import Talk
from unit.edge_agent.protocol import test_robot_machine as histories


class RecordedBench(Bench):
    """Adds all messages to the conversation of the running machine."""

    talk: ClassVar[Talk]

    def do(self, *events: Event) -> list[Effect]:
        effects: list[Effect] = []
        for event in events:
            if isinstance(event, OrderReceived):
                self.talk.say(event.order)
            elif isinstance(event, InstantActionsReceived):
                self.talk.say(event.message)
            effects += super().do(event)
            self.talk.say(self.state)
        return effects


@pytest.mark.parametrize("version", CODECS)
def test_checker_accepts_conversations_of_the_core(version: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(histories, "Bench", RecordedBench)
    checked = 0

    class Machine(histories.RobotMachine):
        def __init__(self, *arguments: Any) -> None:
            RecordedBench.talk = self.talk = Talk(version)
            super().__init__(*arguments)

        def teardown(self) -> None:
            nonlocal checked
            super().teardown()
            checked += len(self.talk.entries)
            found = [each for each in self.talk.findings if SENDERS[each.topic] is Sender.ROBOT]
            assert [each for each in found if each.severity is Severity.ERROR] == []

    Machine.version = version
    few = settings(max_examples=EXAMPLES // 100 + 1, stateful_step_count=40)
    run_state_machine_as_test(Machine, settings=few)
    assert checked > 100
