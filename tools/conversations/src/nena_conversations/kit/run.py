"""Run the clauses for a robot, one after the other, and judge what the checker saw meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from nena_conversations.broker import BrokerAddress, connect_broker
from nena_conversations.kit.clause import Clause, ClauseFailedError, Verdict
from nena_conversations.kit.engine import OF_EACH_TOPIC, Watched, try_clause, watched_verdict
from nena_conversations.kit.robot_clauses import ROBOT_CLAUSES
from nena_conversations.kit.session import ANSWER_WITHIN, Person, Place, RobotSession
from nena_conversations.recording import Entry
from nena_conversations.rules import Rule
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme

FIRST_STATE_WITHIN: Final = 31.0
"""A robot sends a state at least every 30 s, seconds."""
ROBOT_TOPICS: Final = (Topic.STATE, Topic.CONNECTION, Topic.FACTSHEET, Topic.VISUALIZATION)
OF_THE_CONVERSATION: Final = {
    Rule.CONNECTION: "Only a robot that is ONLINE sends states",
    Rule.STATE_INTERVAL: "States come in time throughout the test",
    Rule.ANSWER: "Each order is echoed, or named in an error",
    Rule.INSTANT_ANSWER: "Each instant action gets a state",
    Rule.ECHO: "States have an order and update that were sent",
    Rule.PROGRESS: "Nodes disappear in order, without gaps, and never reappear",
    Rule.FIRST_NODE: "The first node counts as reached at once",
    Rule.ACTION_LOST: "Each action has a state from its acceptance on",
    Rule.ACTION_STATUS: "The status of an action changes as the standard allows",
    Rule.ACTION_EARLY: "An action begins when its node is reached",
    Rule.BLOCKING: "HARD and SINGLE actions run alone, without driving beside HARD and SOFT ones",
    Rule.CANCEL_END: "Nothing of the order remains when cancelOrder is FINISHED",
}
"""Rules that are judged for the conversation as a whole."""


@dataclass(frozen=True, slots=True)
class RobotUnderTest:
    """The robot, and what it may do."""

    robot: RobotKey
    topics: TopicScheme
    codec: Codec
    plan: tuple[Place, ...]
    """Places to which it may drive; empty: it does not move."""
    action: str = ""
    """Type of an action that it may do at a node; empty: none."""


async def judge_robot(
    address: BrokerAddress,
    tested: RobotUnderTest,
    *,
    clauses: Sequence[Clause[RobotSession]] = ROBOT_CLAUSES,
    report: Callable[[Verdict], None],
    client_id: str,
    answer_within: float = ANSWER_WITHIN,
    person: Person | None = None,
) -> tuple[list[Verdict], tuple[Entry, ...]]:
    """Test a robot; return the verdicts and the recorded messages.

    Raises:
        BrokerError: the broker is unreachable or rejects the subscriptions.
    """
    verdicts: list[Verdict] = []

    def add(verdict: Verdict) -> None:
        verdicts.append(verdict)
        report(verdict)

    async with connect_broker(address, client_id) as link:
        session = RobotSession(
            link,
            tested.topics,
            tested.robot,
            tested.codec,
            plan=tested.plan,
            action=tested.action,
            answer_within=answer_within,
            person=person,
        )
        session.send_instant("stateRequest")  # a robot at rest may be silent for 30 s
        for clause in clauses:
            section = clause.sections.of(tested.codec.version)
            if section is not None:
                add(await try_clause(clause, section, session))
        session.findings += session.checker.end()
    for verdict in _seen_by_checker(session, tested.codec.version):
        add(verdict)
    return verdicts, tuple(session.recording)


def _seen_by_checker(session: RobotSession, version: str) -> Iterator[Verdict]:
    """Yield a verdict for each rule that the checker of conversations has watched."""
    found, entries = session.findings, session.recording
    for topic in ROBOT_TOPICS:
        heard = session.heard.counts[topic]
        for rule, title in OF_EACH_TOPIC.items():
            missing = "" if heard else f"no message on {topic} was heard"
            yield from watched_verdict(Watched(rule, title, topic, missing), version, found, entries)
    for rule, title in OF_THE_CONVERSATION.items():
        yield from watched_verdict(Watched(rule, title), version, found, entries)


async def first_state(address: BrokerAddress, tested: RobotUnderTest, client_id: str) -> State | None:
    """Return the robot's first state, None if none comes; raises BrokerError."""
    async with connect_broker(address, client_id) as link:
        session = RobotSession(link, tested.topics, tested.robot, tested.codec)
        session.send_instant("stateRequest")
        with suppress(ClauseFailedError):
            return await session.state(lambda _: True, "a state", FIRST_STATE_WITHIN)
    return None
