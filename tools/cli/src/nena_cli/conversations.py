"""``nena vda5050``: record, replay, show, check."""

from __future__ import annotations

import asyncio
import json
import os
import re
import sys
from collections.abc import Callable, Coroutine, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from os import getpid
from pathlib import Path
from typing import Annotated, Any, Final, TypeVar

import typer
from rich.console import Console
from rich.markup import escape

from nena_cli.options import PLAIN
from nena_cli.output import echo, fail
from nena_conversations import broker
from nena_conversations.broker import BrokerError, EntryFilter
from nena_conversations.checker import Checker
from nena_conversations.kit import report
from nena_conversations.kit.clause import Clause, ClauseFailedError, NotApplicableError, Verdict
from nena_conversations.kit.fleet_clauses import FLEET_CLAUSES
from nena_conversations.kit.fleet_run import ORDER_WITHIN, PACE, WATCH, PlayedSetup, judge_fleet
from nena_conversations.kit.fleet_session import Ask, Wanted
from nena_conversations.kit.run import RobotUnderTest, first_state, judge_robot
from nena_conversations.kit.session import ANSWER_WITHIN
from nena_conversations.message import Sender
from nena_conversations.recording import Entry, RecordingError, append, new_file, read, read_file
from nena_conversations.rules import Finding, Severity
from nena_conversations.show import show as show_conversation
from nena_shared import log
from nena_shared.clock import iso
from nena_shared.settings import ConfigurationError, LogSettings, MqttTlsSettings
from nena_shared.tasks import TaskFailedError, stop_on_signals
from nena_shared.vda5050.topics import RobotKey, Topic
from nena_shared.vda5050.versions import UnknownVersionError, codec_named, topics_for

app = typer.Typer(no_args_is_help=True, add_completion=False, rich_markup_mode=PLAIN)

T = TypeVar("T")

EXPECTED: Final = (RecordingError, BrokerError, ClauseFailedError, UnknownVersionError, ConfigurationError)

MAX_PLAYED: Final = 10
"""Maximum number of robots that a test plays."""
PLAYED: Final = re.compile(
    r"(?P<manufacturer>[^/@:]+)/(?P<serial>[^/@:]+)(?:@(?P<version>[\d.]+))?(?::(?P<place>.+))?"
)

FOUND: Final = 1
"""Exit status of a check that found errors."""

Broker = Annotated[str, typer.Argument(help="mqtt[s]://host:port, optionally with /topic/filter.")]
User = Annotated[str | None, typer.Option("--username", help="User name at the broker.")]
Password = Annotated[Path | None, typer.Option("--password-file", help="File with the password.")]
Filters = Annotated[list[str] | None, typer.Option("--topic", help="Topic filter; repeatable.")]
Interface = Annotated[
    str, typer.Option("--interface", help="interfaceName (topic prefix). Unset: any single level.")
]
Robot = Annotated[str | None, typer.Option("--robot", help="Only this robot: manufacturer/serialNumber.")]
Seconds = Annotated[float | None, typer.Option(min=0, help="Stop after this many seconds.")]
Messages = Annotated[int | None, typer.Option(min=1, help="Stop after this many messages.")]


@app.callback()
def tls_options(
    ctx: typer.Context,
    *,
    ca: Annotated[Path | None, typer.Option(help="CA bundle (PEM) for the broker; enables TLS.")] = None,
    certificate: Annotated[Path | None, typer.Option(help="Client certificate (PEM).")] = None,
    key: Annotated[Path | None, typer.Option(help="Private key of the client certificate (PEM).")] = None,
) -> None:
    """Record, replay, show and check conversations between VDA 5050 robots and their fleet control."""
    log.configure(LogSettings(level="warning"))
    ctx.obj = MqttTlsSettings(ca=ca, certificate=certificate, key=key)


@app.command()
def record(
    ctx: typer.Context,
    url: Broker,
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
    """Record a broker's VDA 5050 messages until Ctrl-C or the given limit."""
    with _errors_reported():
        filters = _topic_filters(topic, interface, robot)
        address = broker.parse_address(
            url, username=username, password_file=password_file, tls=ctx.obj, filters=filters
        )
        with new_file(file) as out:
            count = _listen_to_broker(address, lambda entry: append(entry, out), seconds, messages)
    echo(f"{count} messages recorded in {file}")


@app.command()
def replay(
    ctx: typer.Context,
    file: Annotated[Path, typer.Argument(help="A recording.")],
    url: Broker,
    *,
    username: User = None,
    password_file: Password = None,
    speed: Annotated[float, typer.Option(min=0.001, help="Speed factor.")] = 1.0,
    only: Annotated[Sender | None, typer.Option(help="Replay only messages of this side.")] = None,
    topic: Filters = None,
    interface: Interface = "+",
    robot: Robot = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="New headers: headerId from 0, current timestamp.")
    ] = False,
    seconds: Seconds = None,
    messages: Messages = None,
) -> None:
    """Publish a recording to a broker until its end, Ctrl-C or the given limit."""
    with _errors_reported():
        address = broker.parse_address(url, username=username, password_file=password_file, tls=ctx.obj)
        wanted = EntryFilter(only, _topic_filters(topic, interface, robot))
        entries = [each for each in read_file(file) if wanted.matches(each)][:messages]
        client_id = f"nena-replay-{getpid()}"

        def work(stop: asyncio.Event) -> Coroutine[Any, Any, int]:
            return broker.replay(entries, address, speed=speed, fresh=fresh, stop=stop, client_id=client_id)

        count = asyncio.run(_until_stopped(work, seconds))
    echo(f"{count} messages published")


@app.command()
def show(
    file: Annotated[str, typer.Argument(help="A recording, or - for standard input.")],
    *,
    robot: Robot = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Include visualization and states without changes.")
    ] = False,
) -> None:
    """Show a conversation: who sent what, and what changed."""
    console = Console(soft_wrap=True)
    with _errors_reported():
        shown = show_conversation(_read_entries(file), console, robot=robot, everything=everything)
    if not shown:
        echo("The recording has no VDA 5050 messages.")


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
    strict: Annotated[bool, typer.Option("--strict", help="Treat warnings as errors.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print findings as JSON lines.")] = False,
) -> None:
    """Check a conversation against VDA 5050; the exit status is 1 if it has errors or no such message."""
    checker = Checker()
    found = dict.fromkeys(Severity, 0)

    def report(findings: Iterator[Finding]) -> None:
        for finding in findings:
            found[finding.severity] += 1
            _print_finding(finding, as_json=as_json)

    with _errors_reported():
        filters = _topic_filters(topic, interface, robot)
        if broker.is_broker(source):
            address = broker.parse_address(
                source, username=username, password_file=password_file, tls=ctx.obj, filters=filters
            )
            _listen_to_broker(address, lambda entry: report(checker.add(entry)), seconds, messages)
        else:
            wanted = EntryFilter(topic_filters=filters)
            for entry in _read_entries(source):
                if wanted.matches(entry):
                    report(checker.add(entry))
                else:
                    checker.skip()
        report(checker.end())
    errors, warnings = found[Severity.ERROR], found[Severity.WARNING]
    echo(f"{checker.checked} messages checked, {errors} errors, {warnings} warnings")
    if not checker.checked:
        seen = f", such as {checker.other_topic!r}" if checker.other_topic else ""
        echo(f"No message has a topic of VDA 5050 (interface/v2/manufacturer/serialNumber/state){seen}.")
    raise typer.Exit(FOUND if errors or not checker.checked or (strict and warnings) else 0)


tests = typer.Typer(
    no_args_is_help=True, rich_markup_mode=PLAIN, help="Test a robot or a fleet control against VDA 5050."
)
app.add_typer(tests, name="test")

OwnInterface = Annotated[
    str | None, typer.Option("--interface", help="interfaceName (topic prefix); default: the standard's.")
]
Html = Annotated[Path | None, typer.Option(help="Write the report as one HTML file.")]
Junit = Annotated[Path | None, typer.Option(help="Write the report as JUnit XML.")]
Badge = Annotated[Path | None, typer.Option(help="Write the result as an SVG image for a README.")]
JsonFile = Annotated[Path | None, typer.Option("--json", help="Write the report as JSON.")]
Recorded = Annotated[Path | None, typer.Option(help="Write all messages to this file.")]


@tests.command("robot")
def judge(
    ctx: typer.Context,
    url: Broker,
    robot: Annotated[str, typer.Argument(metavar="MANUFACTURER/SERIAL", help="The robot.")],
    *,
    version: Annotated[str, typer.Option("--version", help="VDA 5050 version of the robot.")],
    interface: OwnInterface = None,
    place: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y", help="Place in the robot's map that it may drive to, m; repeatable."),
    ] = None,
    square: Annotated[
        float | None, typer.Option(min=1, max=20, help="Instead: drive within this square around it, m.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Drive without asking first.")] = False,
    action: Annotated[
        str,
        typer.Option(metavar="TYPE", help="Action for one node, without parameters. It is done for real."),
    ] = "",
    person: Annotated[
        bool, typer.Option("--person", help="Ask for what needs a person at the robot, on the terminal.")
    ] = False,
    answer_within: Annotated[
        float,
        typer.Option(min=0.1, help="Time for the robot's answers, s; drives take up to six times that."),
    ] = ANSWER_WITHIN,
    username: User = None,
    password_file: Password = None,
    html: Html = None,
    junit: Junit = None,
    badge: Badge = None,
    json_file: JsonFile = None,
    recording: Recorded = None,
) -> None:
    """Act as a robot's fleet control and judge it clause by clause; status 1 if it violates one.

    Without places or a square, the robot is not moved, and clauses on drives do not apply.
    """
    files = Reports(html, junit, badge, json_file, recording)
    files.check()
    manufacturer, _, serial = robot.partition("/")
    if not serial:
        fail(f"{robot!r} is no robot: use MANUFACTURER/SERIAL, as in its topics")
    client_id = f"nena-test-{getpid()}"
    with _errors_reported():
        codec = codec_named(version)
        address = broker.parse_address(url, username=username, password_file=password_file, tls=ctx.obj)
        topics = topics_for(codec.version, interface)
        tested = RobotUnderTest(
            RobotKey(manufacturer, serial), topics, codec, tuple(map(_place_of, place or ())), action
        )
        state = asyncio.run(first_state(address, tested, client_id))
        if state is None:
            topic = topics.of(tested.robot, Topic.STATE)
            fail(
                f"{robot} has sent no state on {topic}: is it on? Compare its name, --version and --interface"
            )
        if state.version != codec.version:
            echo(f"nena: {robot} says version {state.version}, and is judged by {codec.version}")
        if square is not None:
            if state.mobile_robot_position is None:
                fail(f"{robot} sends no position, so there is no square around it: localise it first")
            x, y = state.mobile_robot_position.x, state.mobile_robot_position.y
            half = square / 2
            tested = replace(tested, plan=((x, y), (x + half, y), (x + half, y + half)))
        if tested.plan and not yes:
            where = ", then ".join(f"({x:.2f}, {y:.2f})" for x, y in tested.plan)
            question = f"{robot} will drive between {where}, without looking for people. Go on?"
            try:
                typer.confirm(question, abort=True)
            except typer.Abort:
                fail("not started: nobody has agreed to the drives; --yes does")
        verdicts, entries = asyncio.run(
            judge_robot(
                address,
                tested,
                report=_print_verdict,
                client_id=client_id,
                answer_within=answer_within,
                person=_ask_at_the_robot if person else None,
            )
        )
        about = {"robot": robot, "version": codec.version}
        _write_reports(verdicts, entries, about, files)


@tests.command("fleet")
def judge_fleet_control(
    ctx: typer.Context,
    url: Broker,
    robots: Annotated[
        list[str],
        typer.Argument(
            metavar="MANUFACTURER/SERIAL[@VERSION][:X,Y]...",
            help="Robots to play, 1 to 10, as the fleet control knows them; where they stand in its map, m.",
        ),
    ],
    *,
    version: Annotated[str, typer.Option("--version", help="Version of robots that name none.")] = "2.1.0",
    interface: OwnInterface = None,
    map_id: Annotated[str, typer.Option("--map", help="mapId of the robots.")] = "map",
    action: Annotated[
        list[str] | None, typer.Option(help="Type of an action that the robots can do; repeatable.")
    ] = None,
    clause: Annotated[
        list[str] | None, typer.Option(help="Try only this clause, such as order/start; repeatable.")
    ] = None,
    order_interval: Annotated[
        float, typer.Option(min=0, help="Shortest time between two orders that the robots declare, s.")
    ] = 1.0,
    command: Annotated[
        str | None,
        typer.Option(
            help="Shell command that starts what $WANTED names (order, cancel, release) for $ROBOT."
        ),
    ] = None,
    answer_within: Annotated[
        float, typer.Option(min=0.1, help="Time for an order to come, s.")
    ] = ORDER_WITHIN,
    watch: Annotated[
        float, typer.Option(min=0.3, help="How long to watch that something does not come, s.")
    ] = WATCH,
    pace: Annotated[float, typer.Option(min=0.02, help="Time of a robot for each node, s.")] = PACE,
    username: User = None,
    password_file: Password = None,
    html: Html = None,
    junit: Junit = None,
    badge: Badge = None,
    json_file: JsonFile = None,
    recording: Recorded = None,
) -> None:
    """Play robots for a fleet control and judge what it sends; status 1 if it violates a clause.

    Start orders when the command asks for them, or let --command do it.
    """
    files = Reports(html, junit, badge, json_file, recording)
    files.check()
    if len(robots) > MAX_PLAYED:
        fail(f"{len(robots)} robots are too many: at most {MAX_PLAYED} can be played")
    client_id = f"nena-test-{getpid()}"
    with _errors_reported():
        setups = [
            replace(
                _played_robot(each, version, interface, map_id),
                actions=tuple(action or ()),
                order_interval=order_interval,
            )
            for each in robots
        ]
        address = broker.parse_address(url, username=username, password_file=password_file, tls=ctx.obj)
        verdicts, entries = asyncio.run(
            judge_fleet(
                address,
                setups,
                _ask_with(command) if command else _ask_a_person,
                clauses=_chosen(FLEET_CLAUSES, clause),
                report=_print_verdict,
                client_id=client_id,
                answer_within=answer_within,
                watch=watch,
                pace=pace,
            )
        )
        versions = ", ".join(dict.fromkeys(each.codec.version for each in setups))
        about = {"fleet control": url.rpartition("@")[2], "version": versions}
        _write_reports(verdicts, entries, about, files)


def _chosen(clauses: Sequence[Clause[T]], names: list[str] | None) -> list[Clause[T]]:
    if unknown := set(names or ()) - {each.id for each in clauses}:
        known = ", ".join(each.id for each in clauses)
        fail(f"There is no clause {', '.join(sorted(unknown))}; there are {known}")
    return [each for each in clauses if not names or each.id in names]


def _played_robot(text: str, version: str, interface: str | None, map_id: str) -> PlayedSetup:
    found = PLAYED.fullmatch(text)
    if not found:
        fail(f"{text!r} is no robot: use MANUFACTURER/SERIAL, MANUFACTURER/SERIAL@2.1:X,Y with X and Y in m")
    codec = codec_named(found["version"] or version)
    x, y = _place_of(found["place"] or "0,0")
    key = RobotKey(found["manufacturer"], found["serial"])
    return PlayedSetup(key, codec, topics_for(codec.version, interface), (x, y, 0.0), map_id)


async def _ask_a_person(wanted: Wanted, robot: RobotKey) -> None:
    what = {
        Wanted.ORDER: f"start an order for {robot}",
        Wanted.CANCEL: f"cancel the order of {robot}",
        Wanted.RELEASE: f"use {robot} again, if its refusals have put it out of service",
    }
    Console(soft_wrap=True, highlight=False).print(f"[bold]In the fleet control, please {what[wanted]}.[/]")


def _ask_with(command: str) -> Ask:
    async def ask(wanted: Wanted, robot: RobotKey) -> None:
        environment = {**os.environ, "WANTED": wanted.value, "ROBOT": str(robot)}
        done = await asyncio.create_subprocess_shell(command, env=environment)
        if status := await done.wait():
            echo(f"The command for {wanted.value} of {robot} ended with status {status}")

    return ask


@dataclass(frozen=True, slots=True)
class Reports:
    """Files to write about a test."""

    html: Path | None
    junit: Path | None
    badge: Path | None
    json: Path | None
    recording: Path | None

    def check(self) -> None:
        """Fail before a test if a file cannot be written after it."""
        for path in filter(None, (self.html, self.junit, self.badge, self.json, self.recording)):
            if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
                fail(f"{path} cannot be written: choose another name in a folder that exists")
        if self.recording and self.recording.exists():
            fail(f"{self.recording} already exists; choose another name or delete it")


def _write_reports(
    verdicts: Sequence[Verdict], entries: Iterable[Entry], about: dict[str, str], files: Reports
) -> None:
    """Show and write what became of a test, and exit."""
    about = {**about, "time": iso(datetime.now(UTC))}
    Console(soft_wrap=True).print(report.table(verdicts))
    if files.html:
        files.html.write_text(report.as_html(verdicts, about), encoding="utf-8")
    if files.junit:
        files.junit.write_bytes(report.as_junit(verdicts, about))
    if files.badge:
        files.badge.write_text(report.as_badge(verdicts, about), encoding="utf-8")
    if files.json:
        files.json.write_bytes(report.as_json(verdicts, about))
    if files.recording:
        with new_file(files.recording) as out:
            for entry in entries:
                append(entry, out)
    echo(f"{report.summary(verdicts)}; VDA 5050 {about['version']}")
    raise typer.Exit(FOUND if report.violations(verdicts) else 0)


async def _ask_at_the_robot(what: str) -> None:
    question = f"Please {what}, then press Enter (s: skip)"
    if await asyncio.to_thread(typer.prompt, question, default="", show_default=False) == "s":
        raise NotApplicableError(f"skipped: {what}")


def _place_of(text: str) -> tuple[float, float]:
    try:
        x, y = map(float, text.split(","))
    except ValueError:
        fail(f"{text!r} is no place: use X,Y in m, such as 2.5,-1")
    return x, y


def _print_verdict(verdict: Verdict) -> None:
    colour = report.colour_of(verdict)
    console = Console(soft_wrap=True, highlight=False)
    console.print(f"[{colour}]{verdict.words:<15}[/] {escape(verdict.id)} [dim]{verdict.section}[/]")


def _topic_filters(topics: list[str] | None, interface: str, robot: str | None) -> tuple[str, ...]:
    """Return the chosen topic filters; empty: all topics."""
    chosen = tuple(topics or ())
    if robot is not None or interface != "+":
        chosen += broker.robot_filters(interface, robot or "+/+")
    return chosen


def _print_finding(finding: Finding, *, as_json: bool) -> None:
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


def _read_entries(source: str) -> Iterator[Entry]:
    return read(sys.stdin, "standard input") if source == "-" else read_file(Path(source))


def _listen_to_broker(
    address: broker.BrokerAddress,
    handle: Callable[[Entry], None],
    seconds: float | None,
    messages: int | None,
) -> int:
    """Handle messages until a signal or a limit; return their number."""
    count = 0

    def work(stop: asyncio.Event) -> Coroutine[Any, Any, None]:
        def counted(entry: Entry) -> None:
            nonlocal count
            count += 1
            handle(entry)
            if count == messages:
                stop.set()

        return broker.listen(address, counted, stop=stop, client_id=f"nena-listen-{getpid()}")

    asyncio.run(_until_stopped(work, seconds))
    return count


async def _until_stopped(work: Callable[[asyncio.Event], Coroutine[Any, Any, T]], seconds: float | None) -> T:
    """Run work with an event that is set by a signal or after ``seconds``."""
    stop = asyncio.Event()
    stop_on_signals(stop)
    if seconds is not None:
        asyncio.get_running_loop().call_later(seconds, stop.set)
    return await work(stop)


@contextmanager
def _errors_reported() -> Iterator[None]:
    """Report an expected error in one line and exit with status 2."""
    try:
        yield
    except (*EXPECTED, TaskFailedError, OSError) as error:
        fail(error)
