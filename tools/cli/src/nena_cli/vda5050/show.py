"""A conversation as a person reads it: who said what, and what has changed by it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import datetime

from rich.console import Console
from rich.text import Text

from nena_cli.vda5050.changes import in_words
from nena_cli.vda5050.recording import Entry
from nena_cli.vda5050.said import Said, Speaker, understand
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey, Topic

QUIET = (Topic.VISUALIZATION,)
"""Topics that are shown on request only."""


def show(
    entries: Iterable[Entry], console: Console, *, robot: str | None = None, everything: bool = False
) -> int:
    """Print a conversation, of one robot (``manufacturer/serialNumber``) or of all; gives the count."""
    shown = 0
    for said, lines in readable(entries):
        if robot not in (None, str(said.robot)) or (said.topic in QUIET and not everything):
            continue
        if lines == ["nothing new"] and not everything:
            continue
        shown += 1
        console.print(
            _heading(said), *(f"    {line}" for line in lines), sep="\n", markup=False, highlight=False
        )
    return shown


def readable(entries: Iterable[Entry]) -> Iterator[tuple[Said, list[str]]]:
    """Give each message of VDA 5050 with what it says; states by what they change."""
    states: dict[RobotKey, State] = {}
    for number, entry in enumerate(entries, start=1):
        said = understand(entry, number)
        if said is None:
            continue
        if said.message is None:
            yield said, [f"not readable: {problem}" for problem in said.problems]
            continue
        yield said, in_words(said.message, states.get(said.robot))
        if isinstance(said.message, State):
            states[said.robot] = said.message


def _heading(said: Said) -> Text:
    to_robot = said.speaker is Speaker.FLEET
    way = f"fleet → {said.robot}" if to_robot else f"{said.robot} → fleet"
    colour = "cyan" if to_robot else "green"
    if said.message is None:
        colour = "red"
    kept = " (kept by the broker)" if said.retained else ""
    return Text.assemble(
        (f"{said.number:>6} {_clock(said.time)} ", "dim"),
        (f"{way} {said.topic}", colour),
        (f" {said.codec.version}{kept}", "dim"),
    )


def _clock(time: datetime) -> str:
    return f"{time:%H:%M:%S}.{time.microsecond // 1000:03d}"
