"""The doctor's finding for each link, in the order in which links depend on each other."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum


class Link(StrEnum):
    """The links between fleet control and the robot's drive, in order."""

    BROKER = "broker"
    LOGIN = "login"
    ACCESS = "access"
    DOMAIN = "ROS domain"
    NAMESPACE = "namespace"
    LOCALISATION = "localisation"
    NAVIGATION = "Nav2"
    MAP = "map"
    CLOCK = "clock"
    POWER = "power"


class LinkVerdict(StrEnum):
    """State of a link."""

    OK = "ok"
    DOUBTFUL = "doubtful"
    """The link works, but perhaps not as intended."""
    MISSING = "MISSING"
    UNKNOWN = "-"
    """Not checked, because an earlier link is missing or the robot has no such link."""


@dataclass(frozen=True, slots=True)
class LinkFinding:
    """The result for a link; ``remedy`` explains what to do if it is not OK."""

    link: Link
    verdict: LinkVerdict
    text: str
    remedy: str = ""


def ok(link: Link, text: str) -> LinkFinding:
    """Return the finding for a working link."""
    return LinkFinding(link, LinkVerdict.OK, text)


def missing(link: Link, text: str, remedy: str) -> LinkFinding:
    """Return the finding for a missing link."""
    return LinkFinding(link, LinkVerdict.MISSING, text, remedy)


def unknown(links: Iterable[Link], text: str) -> list[LinkFinding]:
    """Return the findings for links that were not checked."""
    return [LinkFinding(link, LinkVerdict.UNKNOWN, text) for link in links]


def report(findings: Sequence[LinkFinding]) -> str:
    """Return the findings as text: one line each, and a second one with the remedy if there is one."""
    lines = []
    for finding in findings:
        lines.append(f"{finding.verdict:<9} {finding.link:<13} {finding.text}")
        if finding.remedy:
            lines.append(f"{'':<9} {'':<13} -> {finding.remedy}")
    first = next((finding.link for finding in findings if finding.verdict is LinkVerdict.MISSING), None)
    lines.append(f"The first missing link: {first}." if first else "No link is missing.")
    return "\n".join(lines) + "\n"
