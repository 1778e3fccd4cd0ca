"""What the doctor finds about each link, in the order in which they build on each other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum


class Link(StrEnum):
    """The links between fleet control and the robot's drive, from one end to the other."""

    BROKER = "broker"
    LOGIN = "login"
    ACCESS = "access"
    DOMAIN = "ROS domain"
    NAMESPACE = "namespace"
    LOCALISATION = "localisation"
    NAVIGATION = "Nav2"
    MAP = "map"
    CLOCK = "clock"


class LinkVerdict(StrEnum):
    """How a link is."""

    OK = "ok"
    DOUBTFUL = "doubtful"
    """It works, and may not do what is wanted."""
    MISSING = "MISSING"
    UNKNOWN = "-"
    """Not checked, because a link before it is missing or the robot has none."""


@dataclass(frozen=True, slots=True)
class LinkFinding:
    """The result for one link; ``remedy`` is what to do if it is not OK."""

    link: Link
    verdict: LinkVerdict
    text: str
    remedy: str = ""


def ok(link: Link, text: str) -> LinkFinding:
    """Build the finding of a link that is well."""
    return LinkFinding(link, LinkVerdict.OK, text)


def missing(link: Link, text: str, remedy: str) -> LinkFinding:
    """Build the finding of a link that is missing."""
    return LinkFinding(link, LinkVerdict.MISSING, text, remedy)


def unknown(links: Iterable[Link], text: str) -> list[LinkFinding]:
    """Build the findings of links that were not checked."""
    return [LinkFinding(link, LinkVerdict.UNKNOWN, text) for link in links]


def report(findings: Sequence[LinkFinding]) -> str:
    """Write the findings for a person, one line each and one more if there is something to do."""
    lines = []
    for each in findings:
        lines.append(f"{each.verdict:<9} {each.link:<13} {each.text}")
        if each.remedy:
            lines.append(f"{'':<9} {'':<13} -> {each.remedy}")
    first = next((each.link for each in findings if each.verdict is LinkVerdict.MISSING), None)
    lines.append(f"The first missing link: {first}." if first else "No link is missing.")
    return "\n".join(lines) + "\n"
