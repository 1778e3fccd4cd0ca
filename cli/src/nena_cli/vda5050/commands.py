"""``nena vda5050``: record, replay, show, check."""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager, suppress
from os import getpid
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from rich.console import Console
from rich.markup import escape

from nena_cli.vda5050 import broker
from nena_cli.vda5050.checker import Checker
from nena_cli.vda5050.finding import Finding, Severity
from nena_cli.vda5050.recording import Entry, RecordingError, append, read, read_file
from nena_cli.vda5050.said import Speaker
from nena_cli.vda5050.show import show as show_conversation
from nena_shared.settings import ConfigurationError
from nena_shared.tasks import TaskFailedError, stop_on_signals

app = typer.Typer(help="Conversations of VDA 5050 robots and fleet controls.", no_args_is_help=True)

FOUND: Final = 1
"""Exit status of a check that has found errors."""
WRONG: Final = 2
"""Exit status of a command that could not do its work."""

Broker = Annotated[str, typer.Argument(help="mqtt://host:port, with /topic/filter where not all is wanted.")]
User = Annotated[str | None, typer.Option("--username", help="User name at the broker.")]
Password = Annotated[Path | None, typer.Option("--password-file", help="File with the password.")]
Filters = Annotated[
    list[str] | None, typer.Option("--topic", help="Topic filter; may be given several times.")
]
Seconds = Annotated[float | None, typer.Option(min=0, help="Stop after so many seconds.")]
Messages = Annotated[int | None, typer.Option(min=1, help="Stop after so many messages.")]


@app.command()
def record(
    where: Broker,
    file: Annotated[Path, typer.Argument(help="File to write: JSON lines.")],
    *,
    username: User = None,
    password_file: Password = None,
    topic: Filters = None,
    seconds: Seconds = None,
    messages: Messages = None,
) -> None:
    """Record what goes over a broker, until Ctrl-C or the given end."""
    with _faults_told():
        chosen = broker.place(
            where, username=username, password_file=password_file, filters=tuple(topic or ())
        )
        with file.open("x", encoding="utf-8") as out:
            count = _listen(chosen, lambda entry: append(entry, out), seconds, messages)
    _say(f"{count} messages recorded in {file}")


@app.command()
def replay(
    file: Annotated[Path, typer.Argument(help="A recording.")],
    where: Broker,
    *,
    username: User = None,
    password_file: Password = None,
    speed: Annotated[float, typer.Option(min=0.001, help="How much faster than it was.")] = 1.0,
    only: Annotated[Speaker | None, typer.Option(help="Leave out what the other side said.")] = None,
    fresh: Annotated[bool, typer.Option(help="Put the present time into the headers.")] = False,
) -> None:
    """Publish a recording to a broker."""
    with _faults_told():
        chosen = broker.place(where, username=username, password_file=password_file)
        entries = list(read_file(file))
        count = asyncio.run(
            broker.replay(
                entries, chosen, speed=speed, speaker=only, fresh=fresh, client_id=f"nena-replay-{getpid()}"
            )
        )
    _say(f"{count} messages published")


@app.command()
def show(
    file: Annotated[str, typer.Argument(help="A recording, or - for standard input.")],
    *,
    robot: Annotated[str | None, typer.Option(help="Only this one: manufacturer/serialNumber.")] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Also visualization, and states that change nothing.")
    ] = False,
) -> None:
    """Show a conversation: who said what, and what changed."""
    console = Console(soft_wrap=True)
    with _faults_told():
        shown = show_conversation(_entries(file), console, robot=robot, everything=everything)
    if not shown:
        _say("no message of VDA 5050 in it")


@app.command()
def check(
    source: Annotated[str, typer.Argument(help="A recording, - for standard input, or mqtt://host:port.")],
    *,
    username: User = None,
    password_file: Password = None,
    topic: Filters = None,
    seconds: Seconds = None,
    messages: Messages = None,
    as_json: Annotated[bool, typer.Option("--json", help="Findings as JSON lines.")] = False,
) -> None:
    """Check a conversation against the standard; the exit status is 1 if it breaks it."""
    checker = Checker()
    errors = 0

    def take(findings: Iterator[Finding]) -> None:
        nonlocal errors
        for finding in findings:
            errors += finding.severity is Severity.ERROR
            _print(finding, as_json=as_json)

    with _faults_told():
        if source.startswith("mqtt:"):
            chosen = broker.place(
                source, username=username, password_file=password_file, filters=tuple(topic or ())
            )
            _listen(chosen, lambda entry: take(checker.take(entry)), seconds, messages)
        else:
            for entry in _entries(source):
                take(checker.take(entry))
        take(checker.end())
    _say(f"{checker.checked} messages checked, {errors} errors")
    raise typer.Exit(FOUND if errors else 0)


def _say(text: str, style: str | None = None) -> None:
    """Tell the person at the terminal; standard output belongs to the results."""
    Console(stderr=True, soft_wrap=True).print(text, markup=False, highlight=False, style=style)


def _print(finding: Finding, *, as_json: bool) -> None:
    if as_json:
        line = {
            "number": finding.number,
            "time": finding.time.isoformat(),
            "robot": str(finding.robot),
            "topic": finding.topic.value,
            "version": finding.version,
            "rule": finding.rule.code,
            "section": finding.section,
            "severity": finding.severity.value,
            "text": finding.text,
        }
        sys.stdout.write(json.dumps(line) + "\n")
        sys.stdout.flush()
        return
    colour = "red" if finding.severity is Severity.ERROR else "yellow"
    Console(soft_wrap=True, highlight=False).print(
        f"[dim]{finding.number:>6}[/] {escape(str(finding.robot))} {finding.topic} "
        f"[{colour}]{finding.severity}[/] "
        f"{escape(finding.text)} [dim](VDA 5050 {finding.version}, {finding.section})[/]"
    )


def _entries(source: str) -> Iterator[Entry]:
    return read(sys.stdin, "standard input") if source == "-" else read_file(Path(source))


def _listen(
    where: broker.Place, take: Callable[[Entry], None], seconds: float | None, messages: int | None
) -> int:
    """Take messages until a signal, the time or their number ends it; gives how many came."""
    count = 0

    async def work() -> None:
        stop = asyncio.Event()
        stop_on_signals(stop)

        def counted(entry: Entry) -> None:
            nonlocal count
            if messages is not None and count >= messages:
                return
            count += 1
            take(entry)
            if count == messages:
                stop.set()

        await _at_most(broker.listen(where, counted, stop=stop, client_id=f"nena-listen-{getpid()}"), seconds)

    asyncio.run(work())
    return count


async def _at_most(work: Coroutine[Any, Any, None], seconds: float | None) -> None:
    with suppress(TimeoutError):
        async with asyncio.timeout(seconds):
            await work


@contextmanager
def _faults_told() -> Iterator[None]:
    """End with one clear line where the work cannot be done."""
    try:
        yield
    except (RecordingError, broker.BrokerError, ConfigurationError, TaskFailedError, OSError) as error:
        _say(f"nena: {error}", style="red")
        raise typer.Exit(WRONG) from error
