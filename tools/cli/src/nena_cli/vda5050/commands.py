"""``nena vda5050``: record, replay, show, check."""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from os import getpid
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

import typer
from rich.console import Console
from rich.markup import escape

from nena_cli.shell import give_up, say
from nena_cli.vda5050 import broker
from nena_cli.vda5050.checker import Checker
from nena_cli.vda5050.finding import Finding, Severity
from nena_cli.vda5050.recording import Entry, RecordingError, append, new_file, read, read_file
from nena_cli.vda5050.replay import Choice
from nena_cli.vda5050.said import Speaker
from nena_cli.vda5050.show import show as show_conversation
from nena_shared.settings import ConfigurationError, MqttTlsSettings
from nena_shared.tasks import TaskFailedError, stop_on_signals

app = typer.Typer(help="Conversations of VDA 5050 robots and fleet controls.", no_args_is_help=True)

T = TypeVar("T")

FOUND: Final = 1
"""Exit status of a check that has found errors."""

Broker = Annotated[
    str, typer.Argument(help="mqtt[s]://host:port, with /topic/filter where not all is wanted.")
]
User = Annotated[str | None, typer.Option("--username", help="User name at the broker.")]
Password = Annotated[Path | None, typer.Option("--password-file", help="File with the password.")]
Filters = Annotated[
    list[str] | None, typer.Option("--topic", help="Topic filter; may be given several times.")
]
Interface = Annotated[
    str, typer.Option("--interface", help="First level or levels of the topics; by default any one level.")
]
Robot = Annotated[str | None, typer.Option("--robot", help="Only this one: manufacturer/serialNumber.")]
Seconds = Annotated[float | None, typer.Option(min=0, help="Stop after so many seconds.")]
Messages = Annotated[int | None, typer.Option(min=1, help="Stop after so many messages.")]


@app.callback()
def protected(
    ctx: typer.Context,
    *,
    ca: Annotated[Path | None, typer.Option(help="PEM file: who vouches for the broker. Encrypts.")] = None,
    certificate: Annotated[Path | None, typer.Option(help="PEM file: our own certificate.")] = None,
    key: Annotated[Path | None, typer.Option(help="PEM file: the key of our own certificate.")] = None,
) -> None:
    """Conversations of VDA 5050 robots and fleet controls."""
    ctx.obj = MqttTlsSettings(ca=ca, certificate=certificate, key=key)


@app.command()
def record(
    ctx: typer.Context,
    where: Broker,
    file: Annotated[Path, typer.Argument(help="File to write: JSON lines.")],
    *,
    username: User = None,
    password_file: Password = None,
    topic: Filters = None,
    interface: Interface = "+",
    robot: Robot = None,
    seconds: Seconds = None,
    messages: Messages = None,
) -> None:
    """Record what goes over a broker, until Ctrl-C or the given end."""
    with _faults_told():
        filters = _filters(topic, interface, robot)
        chosen = broker.place(
            where, username=username, password_file=password_file, tls=ctx.obj, filters=filters
        )
        with new_file(file) as out:
            count = _listen(chosen, lambda entry: append(entry, out), seconds, messages)
    say(f"{count} messages recorded in {file}")


@app.command()
def replay(
    ctx: typer.Context,
    file: Annotated[Path, typer.Argument(help="A recording.")],
    where: Broker,
    *,
    username: User = None,
    password_file: Password = None,
    speed: Annotated[float, typer.Option(min=0.001, help="How much faster than it was.")] = 1.0,
    only: Annotated[Speaker | None, typer.Option(help="Leave out what the other side said.")] = None,
    topic: Filters = None,
    interface: Interface = "+",
    robot: Robot = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="New headers: headerIds from 0, the present time.")
    ] = False,
    seconds: Seconds = None,
    messages: Messages = None,
) -> None:
    """Publish a recording to a broker, until its end, Ctrl-C or the given end."""
    with _faults_told():
        chosen = broker.place(where, username=username, password_file=password_file, tls=ctx.obj)
        choice = Choice(only, _filters(topic, interface, robot))
        entries = [each for each in read_file(file) if choice.takes(each)][:messages]
        client_id = f"nena-replay-{getpid()}"

        def work(stop: asyncio.Event) -> Coroutine[Any, Any, int]:
            return broker.replay(entries, chosen, speed=speed, fresh=fresh, stop=stop, client_id=client_id)

        count = asyncio.run(_until_stopped(work, seconds))
    say(f"{count} messages published")


@app.command()
def show(
    file: Annotated[str, typer.Argument(help="A recording, or - for standard input.")],
    *,
    robot: Robot = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Also visualization, and states that change nothing.")
    ] = False,
) -> None:
    """Show a conversation: who said what, and what changed."""
    console = Console(soft_wrap=True)
    with _faults_told():
        shown = show_conversation(_entries(file), console, robot=robot, everything=everything)
    if not shown:
        say("no message of VDA 5050 in it")


@app.command()
def check(
    ctx: typer.Context,
    source: Annotated[str, typer.Argument(help="A recording, - for standard input, or mqtt[s]://host:port.")],
    *,
    username: User = None,
    password_file: Password = None,
    topic: Filters = None,
    interface: Interface = "+",
    robot: Robot = None,
    seconds: Seconds = None,
    messages: Messages = None,
    strict: Annotated[bool, typer.Option("--strict", help="Warnings count as errors do.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Findings as JSON lines.")] = False,
) -> None:
    """Check a conversation against the standard; the exit status is 1 if it breaks it."""
    checker = Checker()
    found = dict.fromkeys(Severity, 0)

    def take(findings: Iterator[Finding]) -> None:
        for finding in findings:
            found[finding.severity] += 1
            _print(finding, as_json=as_json)

    with _faults_told():
        filters = _filters(topic, interface, robot)
        if broker.is_broker(source):
            chosen = broker.place(
                source, username=username, password_file=password_file, tls=ctx.obj, filters=filters
            )
            _listen(chosen, lambda entry: take(checker.take(entry)), seconds, messages)
        else:
            choice = Choice(topic_filters=filters)
            for entry in _entries(source):
                if choice.takes(entry):
                    take(checker.take(entry))
                else:
                    checker.skip()
        take(checker.end())
    errors, warnings = found[Severity.ERROR], found[Severity.WARNING]
    say(f"{checker.checked} messages checked, {errors} errors, {warnings} warnings")
    raise typer.Exit(FOUND if errors or (strict and warnings) else 0)


def _filters(topics: list[str] | None, interface: str, robot: str | None) -> tuple[str, ...]:
    """Give the topic filters that are asked for; none if all are meant."""
    chosen = tuple(topics or ())
    if robot is not None or interface != "+":
        chosen += broker.robot_filters(interface, robot or "+/+")
    return chosen


def _print(finding: Finding, *, as_json: bool) -> None:
    if as_json:
        sys.stdout.write(json.dumps(finding.as_json()) + "\n")
        sys.stdout.flush()
        return
    colour = "red" if finding.severity is Severity.ERROR else "yellow"
    Console(soft_wrap=True, highlight=False).print(
        f"[dim]{finding.number:>6}[/] {escape(str(finding.robot))} {finding.topic} "
        f"[{colour}]{finding.severity}[/] {escape(finding.text)} "
        f"[dim]({finding.rule.code}; VDA 5050 {finding.version}, {finding.section})[/]"
    )


def _entries(source: str) -> Iterator[Entry]:
    return read(sys.stdin, "standard input") if source == "-" else read_file(Path(source))


def _listen(
    where: broker.Place, take: Callable[[Entry], None], seconds: float | None, messages: int | None
) -> int:
    """Take messages until a signal, the time or their number ends it; gives how many came."""
    count = 0

    def work(stop: asyncio.Event) -> Coroutine[Any, Any, None]:
        def counted(entry: Entry) -> None:
            nonlocal count
            count += 1
            take(entry)
            if count == messages:
                stop.set()

        return broker.listen(where, counted, stop=stop, client_id=f"nena-listen-{getpid()}")

    asyncio.run(_until_stopped(work, seconds))
    return count


async def _until_stopped(work: Callable[[asyncio.Event], Coroutine[Any, Any, T]], seconds: float | None) -> T:
    """Do work that ends in order when the event is set: by a signal, or after ``seconds``."""
    stop = asyncio.Event()
    stop_on_signals(stop)
    if seconds is not None:
        asyncio.get_running_loop().call_later(seconds, stop.set)
    return await work(stop)


@contextmanager
def _faults_told() -> Iterator[None]:
    """End with one clear line where the work cannot be done."""
    try:
        yield
    except (RecordingError, broker.BrokerError, ConfigurationError, TaskFailedError, OSError) as error:
        give_up(error)
