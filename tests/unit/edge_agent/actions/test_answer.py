from __future__ import annotations

import pytest

from nena_edge_agent.actions.answer import Answer
from nena_edge_agent.actions.background import WorkFailedError
from nena_edge_agent.actions.message_types import message_type
from nena_edge_agent.actions.settings import AnswerSettings, OperationBase
from nena_edge_agent.actions.values import ActionValues
from support.ros_port import ScriptedRos
from support.waiting import until

TYPE = "std_msgs/msg/String"
NOTHING = ActionValues(OperationBase(action_type="go"))


def listening(**settings: object) -> tuple[ScriptedRos, Answer]:
    ros = ScriptedRos()
    full = {"topic": "said", "type": TYPE, "match": {"data": "done {actionId}"}, "result": "data", **settings}
    return ros, Answer(AnswerSettings.model_validate(full), ros, message_type(TYPE), NOTHING, "p")


async def test_each_who_waits_gets_the_answer_that_is_for_it() -> None:
    ros, answer = listening()
    one = answer.expect({"actionId": "a1"}, print)
    other = answer.expect({"actionId": "a2"}, print)
    ros.say("said", data="done a2")

    assert await other == "done a2"
    assert not one.done()
    one.cancel()
    await until(lambda: answer._waiting == {})
    ros.say("said", data="done a1")


async def test_failure_and_progress_are_told_apart() -> None:
    ros, answer = listening(failed={"data": ["jam", "no power"]}, progress={"data": "half"})
    heard: list[str] = []
    waiting = answer.expect({"actionId": "a1"}, heard.append)
    for text in ("other", "half", "no power", "done a1"):
        ros.say("said", data=text)

    assert heard == ["half"]
    with pytest.raises(WorkFailedError, match="no power"):
        await waiting


async def test_without_a_result_it_says_what_it_can() -> None:
    ros, answer = listening(result="", failed={"data": "jam"})
    assert answer.words == "waits for said"
    waiting = answer.expect({"actionId": "a1"}, print)
    ros.say("said", data="jam")

    with pytest.raises(WorkFailedError, match="said says that it has failed"):
        await waiting


async def test_what_was_said_before_counts_only_where_it_is_latched() -> None:
    for qos, seen in (("reliable", False), ("latched", True)):
        ros, answer = listening(qos=qos)
        ros.say("said", data="done a1")
        waiting = answer.expect({"actionId": "a1"}, print)
        assert waiting.done() is seen
        waiting.cancel()
