"""Checks a whole conversation of any number of robots."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import datetime, timedelta
from typing import Final

from nena_cli.vda5050.bounded import Remembered
from nena_cli.vda5050.finding import Finding, Problem
from nena_cli.vda5050.recording import Entry
from nena_cli.vda5050.robot_conversation import RobotConversation
from nena_cli.vda5050.said import Said, understand

ROBOTS: Final = 10_000
"""Robots that are followed; above that the one that came first is forgotten."""
LOOK_EVERY: Final = timedelta(seconds=1)
"""Of the conversation's time, between two looks at what is overdue at all robots."""


class Checker:
    """Takes messages one by one; ``checked`` counts those that were of VDA 5050."""

    def __init__(self) -> None:
        self.checked = 0
        self._number = 0
        self._now: datetime | None = None
        self._looked: datetime | None = None
        self._robots: Remembered[str, RobotConversation] = Remembered(ROBOTS)
        """By what stands before the last level of their topics: one that changes its version begins anew."""

    def take(self, entry: Entry) -> Iterator[Finding]:
        """Check the next message, and what should have been said by now."""
        self._number += 1
        said = understand(entry, self._number)
        if said is None:
            return
        self.checked += 1
        yield from self._look(said.time)
        if said.place not in self._robots:
            self._robots[said.place] = RobotConversation()
        for problem in self._robots[said.place].check(said):
            yield from _findings(said, problem)

    def skip(self) -> None:
        """Pass over a message that is not meant, so that the numbers stay those of the recording."""
        self._number += 1

    def end(self) -> Iterator[Finding]:
        """Say what was not answered up to the end, where the robot has had chances to."""
        if self._now is not None:
            yield from self._overdue(self._now, ended=True)

    def _look(self, now: datetime) -> Iterator[Finding]:
        self._now = now
        if self._looked is None or now - self._looked >= LOOK_EVERY:
            self._looked = now
            yield from self._overdue(now, ended=False)

    def _overdue(self, now: datetime, *, ended: bool) -> Iterator[Finding]:
        for robot in self._robots.values():
            for late, problem in robot.overdue(now, ended=ended):
                yield from _findings(late, problem)


def _findings(said: Said, problem: Problem) -> Iterator[Finding]:
    """Make a finding, if the message's version has such a rule."""
    rule, severity, text = problem
    section = rule.section(said.codec.version, said.topic)
    if section is not None:
        yield Finding(
            number=said.number,
            time=said.time,
            robot=said.robot,
            topic=said.topic,
            version=said.codec.version,
            rule=rule,
            section=section,
            severity=severity,
            text=text,
        )


def check(entries: Iterable[Entry]) -> Iterator[Finding]:
    """Check a conversation from its beginning to its end."""
    checker = Checker()
    for entry in entries:
        yield from checker.take(entry)
    yield from checker.end()
