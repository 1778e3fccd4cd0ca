"""Checks a whole conversation of any number of robots."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from nena_cli.vda5050.finding import Finding
from nena_cli.vda5050.header_checks import Problem
from nena_cli.vda5050.recording import Entry
from nena_cli.vda5050.robot_conversation import RobotConversation
from nena_cli.vda5050.said import Said, understand
from nena_shared.vda5050.topics import RobotKey


class Checker:
    """Takes messages one by one; ``checked`` counts those that were of VDA 5050."""

    def __init__(self) -> None:
        self.checked = 0
        self._number = 0
        self._robots: dict[RobotKey, RobotConversation] = {}

    def take(self, entry: Entry) -> Iterator[Finding]:
        """Check the next message, and what should have been answered by now."""
        self._number += 1
        said = understand(entry, self._number)
        if said is None:
            return
        self.checked += 1
        robot = self._robots.setdefault(said.robot, RobotConversation())
        for problem in robot.check(said):
            yield _finding(said, problem)
        for late, problem in robot.unanswered(said.time):
            yield _finding(late, problem)

    def end(self) -> Iterator[Finding]:
        """Say what was not answered up to the end, where the robot has had chances to."""
        for robot in self._robots.values():
            for late, problem in robot.unanswered(None):
                yield _finding(late, problem)


def _finding(said: Said, problem: Problem) -> Finding:
    rule, severity, text = problem
    return Finding(
        number=said.number,
        time=said.time,
        robot=said.robot,
        topic=said.topic,
        version=said.codec.version,
        rule=rule,
        severity=severity,
        text=text,
    )


def check(entries: Iterable[Entry]) -> Iterator[Finding]:
    """Check a conversation from its beginning to its end."""
    checker = Checker()
    for entry in entries:
        yield from checker.take(entry)
    yield from checker.end()
