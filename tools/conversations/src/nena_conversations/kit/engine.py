"""Try clauses, and judge what the checker of conversations saw meanwhile."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from time import monotonic
from typing import Final, TypeVar

from nena_conversations.kit.clause import (
    Clause,
    ClauseFailedError,
    NotApplicableError,
    Outcome,
    Strength,
    Verdict,
)
from nena_conversations.kit.session import Listener
from nena_conversations.recording import Entry
from nena_conversations.rules import Finding, Rule, Severity
from nena_shared.vda5050.topics import Topic

S = TypeVar("S", bound=Listener)

OF_EACH_TOPIC: Final = {
    Rule.MESSAGE: "Messages are valid",
    Rule.FIELD: "Messages have only fields of the version",
    Rule.SPELLING: "Names and times are written as the version writes them",
    Rule.VERSION: "Topic and header name the same major version",
    Rule.ADDRESS: "The header names the robot of the topic",
    Rule.HEADER_ID: "headerId increases by one",
    Rule.TIMESTAMP: "Timestamps do not go back",
}
"""Rules that are judged for each topic of the tested side."""


async def try_clause(clause: Clause[S], section: str, session: S, prefix: str = "") -> Verdict:
    """Try a clause and tidy up; return what became of it."""
    began, first = monotonic(), len(session.recording)
    outcome, reason = Outcome.PASSED, ""
    try:
        await session.prepare(moves=clause.moves)
        await clause.run(session)
    except NotApplicableError as error:
        outcome, reason = Outcome.NOT_APPLICABLE, str(error)
    except ClauseFailedError as error:
        outcome, reason = Outcome.FAILED, str(error)
    shown = session.shown(first) if outcome is Outcome.FAILED else []
    try:
        await session.clear()
    except ClauseFailedError as error:
        if outcome is not Outcome.NOT_APPLICABLE:  # nothing was done in it
            outcome, reason = Outcome.FAILED, reason or f"after the clause: {error}"
            shown = shown or session.shown(first)
    return Verdict(
        prefix + clause.id,
        clause.title,
        section,
        clause.strength,
        outcome,
        reason,
        texts(shown),
        monotonic() - began,
        clause.moves,
    )


def texts(entries: Iterable[Entry]) -> tuple[str, ...]:
    """Return messages as a verdict shows them."""
    return tuple(f"{each.topic} {each.payload.decode(errors='replace')}" for each in entries)


@dataclass(frozen=True, slots=True)
class Watched:
    """A rule that the checker of conversations watches throughout a test."""

    rule: Rule
    title: str
    topic: Topic | None = None
    missing: str = ""
    """Why it does not apply; empty: it does."""


def watched_verdict(
    watched: Watched, version: str, findings: Iterable[Finding], entries: Sequence[Entry], prefix: str = ""
) -> Iterator[Verdict]:
    """Yield the verdict on a rule, if the version has it."""
    rule, topic = watched.rule, watched.topic
    section = rule.section(version, topic or Topic.STATE)
    if section is None:
        return
    found = [each for each in findings if each.rule is rule and topic in (None, each.topic)]
    severe = [each for each in found if each.severity is Severity.ERROR]
    worst = (severe or found)[:1]
    yield Verdict(
        f"{prefix}{topic or 'conversation'}/{rule.code}",
        f"{watched.title} ({topic})" if topic else watched.title,
        section,
        Strength.SHOULD if found and not severe else Strength.MUST,
        Outcome.FAILED if found else Outcome.NOT_APPLICABLE if watched.missing else Outcome.PASSED,
        worst[0].text if worst else watched.missing,
        texts(entries[each.number - 1] for each in worst if 0 < each.number <= len(entries)),
    )
