"""Run the clauses for a robot, one after the other, and judge what the checker saw meanwhile."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from time import monotonic
from typing import Final

from nena_conversations.broker import BrokerAddress, connect_broker
from nena_conversations.kit.clause import (
    Clause,
    ClauseFailedError,
    NotApplicableError,
    Outcome,
    Strength,
    Verdict,
)
from nena_conversations.kit.robot_clauses import ROBOT_CLAUSES
from nena_conversations.kit.session import ANSWER_WITHIN, KEPT, Place, RobotSession
from nena_conversations.recording import Entry
from nena_conversations.rules import Rule, Severity
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme

FIRST_STATE_WITHIN: Final = 31.0
"""A robot sends a state at least every 30 s, seconds."""
ROBOT_TOPICS: Final = (Topic.STATE, Topic.CONNECTION, Topic.FACTSHEET, Topic.VISUALIZATION)
OF_EACH_TOPIC: Final = {
    Rule.MESSAGE: "Messages are valid",
    Rule.FIELD: "Messages have only fields of the version",
    Rule.SPELLING: "Names and times are written as the version writes them",
    Rule.VERSION: "Topic and header name the same major version",
    Rule.ADDRESS: "The header names the robot of the topic",
    Rule.HEADER_ID: "headerId increases by one",
    Rule.TIMESTAMP: "Timestamps do not go back",
}
"""Rules that are judged for each of the robot's topics."""
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
TITLES: Final = OF_EACH_TOPIC | OF_THE_CONVERSATION


@dataclass(frozen=True, slots=True)
class RobotUnderTest:
    """The robot, and what it may do."""

    robot: RobotKey
    topics: TopicScheme
    codec: Codec
    plan: tuple[Place, ...]
    """Places to which it may drive; empty: it does not move."""


async def judge_robot(
    address: BrokerAddress,
    tested: RobotUnderTest,
    *,
    clauses: Sequence[Clause] = ROBOT_CLAUSES,
    report: Callable[[Verdict], None],
    client_id: str,
    answer_within: float = ANSWER_WITHIN,
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
            link, tested.topics, tested.robot, tested.codec, plan=tested.plan, answer_within=answer_within
        )
        session.send_instant("stateRequest")  # a robot at rest may be silent for 30 s
        for clause in clauses:
            section = clause.sections.of(tested.codec.version)
            if section is not None:
                add(await _try_clause(clause, section, session))
        session.end_check()
    for verdict in _seen_by_checker(session, tested.codec.version):
        add(verdict)
    return verdicts, tuple(session.recording)


async def _try_clause(clause: Clause, section: str, session: RobotSession) -> Verdict:
    began, first = monotonic(), len(session.recording)
    outcome, reason = Outcome.PASSED, ""
    try:
        if clause.moves:
            session.require_plan(2)
        await clause.run(session)
    except NotApplicableError as error:
        outcome, reason = Outcome.NOT_APPLICABLE, str(error)
    except ClauseFailedError as error:
        outcome, reason = Outcome.FAILED, str(error)
    try:
        await session.clear()
    except ClauseFailedError as error:
        outcome, reason = Outcome.FAILED, reason or f"after the clause: {error}"
    shown = session.recording[first:][-KEPT:] if outcome is Outcome.FAILED else ()
    return Verdict(
        clause.id, clause.title, section, clause.strength, outcome, reason, _texts(shown), monotonic() - began
    )


def _texts(entries: Iterable[Entry]) -> tuple[str, ...]:
    return tuple(f"{each.topic} {each.payload.decode(errors='replace')}" for each in entries)


def _seen_by_checker(session: RobotSession, version: str) -> Iterator[Verdict]:
    """Yield a verdict for each rule that the checker of conversations has watched."""
    entries = session.recording
    pairs = [(rule, topic) for topic in ROBOT_TOPICS for rule in OF_EACH_TOPIC]
    for rule, topic in [*pairs, *((rule, None) for rule in OF_THE_CONVERSATION)]:
        section = rule.section(version, topic or Topic.STATE)
        if section is None:
            continue
        found = [each for each in session.findings if each.rule is rule and topic in (None, each.topic)]
        severe = [each for each in found if each.severity is Severity.ERROR]
        worst = (severe or found)[:1]
        heard = topic is None or session.heard.counts[topic]
        outcome = Outcome.FAILED if found else Outcome.PASSED if heard else Outcome.NOT_APPLICABLE
        yield Verdict(
            f"{topic or 'conversation'}/{rule.code}",
            f"{TITLES[rule]} ({topic})" if topic else TITLES[rule],
            section,
            Strength.SHOULD if found and not severe else Strength.MUST,
            outcome,
            worst[0].text if worst else "" if heard else f"no message on {topic} was heard",
            _texts(entries[each.number - 1] for each in worst if 0 < each.number <= len(entries)),
        )


async def first_position(address: BrokerAddress, tested: RobotUnderTest, client_id: str) -> Place:
    """Return where the robot stands; raises ClauseFailedError and BrokerError."""
    async with connect_broker(address, client_id) as link:
        session = RobotSession(link, tested.topics, tested.robot, tested.codec)
        what = "a state with a position"
        await session.state(lambda state: state.mobile_robot_position, what, FIRST_STATE_WITHIN)
        return session.stand
