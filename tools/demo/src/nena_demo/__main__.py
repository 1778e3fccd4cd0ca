"""Command line of the demo: ``nena-demo run`` for people, ``nena-demo smoke`` for machines."""

from __future__ import annotations

import argparse
import asyncio
import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from nena_demo.host import JobFailedError, RefusedError
from nena_demo.processes import AMQTT_NOTICE, ChildFailedError, mosquitto_path
from nena_demo.session import DemoSession, ProgressPrinter
from nena_demo.stack import NotReadyError, Options
from nena_demo.tour import run_tour
from nena_shared import log
from nena_shared.settings import LogSettings, ShowVersion
from nena_shared.tasks import end, stop_on_signals

EXIT_STOPPED = 130
SMOKE_TIME_FACTOR = 5.0
MOST_ROBOTS = 200
STOP_TIMEOUT = 20.0
"""Timeout for an orderly stop, seconds."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the demo; exit status 0: done, 1: an order stalled or failed, 130: stopped by the user."""
    arguments = _make_parser().parse_args(argv)
    log.configure(LogSettings(level="error"))
    progress = ProgressPrinter(sys.stdout)
    if arguments.broker != "mosquitto" and mosquitto_path() is None:
        progress.line(AMQTT_NOTICE)
    folder = Path(tempfile.mkdtemp(prefix="nena-demo-"))
    try:
        return asyncio.run(_until_stopped(arguments, folder, progress))
    except (ChildFailedError, JobFailedError, RefusedError, NotReadyError) as error:
        progress.line(f"FAILED: {error}")
        _keep_logs(folder, arguments.keep_logs, progress)
        return 1
    finally:
        shutil.rmtree(folder, ignore_errors=True)


async def _until_stopped(arguments: argparse.Namespace, folder: Path, progress: ProgressPrinter) -> int:
    stop = asyncio.Event()
    stop_on_signals(stop)
    work = asyncio.create_task(_run_command(arguments, folder, progress), name="demo")
    stopping = asyncio.create_task(stop.wait(), name="wait for stop")
    await asyncio.wait({work, stopping}, return_when=asyncio.FIRST_COMPLETED)
    stopping.cancel()
    if not work.done():
        progress.line("stopping everything")
        await end(work, again_after=STOP_TIMEOUT)
        if not work.cancelled():
            work.result()  # raises an error that occurred meanwhile
        return EXIT_STOPPED
    return work.result()


async def _run_command(arguments: argparse.Namespace, folder: Path, progress: ProgressPrinter) -> int:
    smoke = arguments.command == "smoke"
    options = Options(
        broker=arguments.broker,
        time_factor=arguments.time_factor or (SMOKE_TIME_FACTOR if smoke else 1.0),
        domain_id=arguments.domain_id,
        separate_domains=arguments.separate_domains,
        panel_port=arguments.panel_port,
        rest_port=arguments.rest_port,
        robots=arguments.robots,
    )
    if not smoke:
        await run_tour(folder, options, progress, sys.stdin.fileno())
        return 0
    async with DemoSession(folder, options, progress) as session:
        await session.do_main_job()
        await session.check_end_state()
        progress.line("smoke run passed")
        return 0


def _keep_logs(folder: Path, target: Path | None, progress: ProgressPrinter) -> None:
    if target is not None:
        shutil.copytree(folder, target, dirs_exist_ok=True)
        progress.line(f"logs kept in {target}")


def _number_of_robots(text: str) -> int:
    if not (text.isdecimal() and 1 <= int(text) <= MOST_ROBOTS):
        raise argparse.ArgumentTypeError(f"'{text}' is not a number from 1 to {MOST_ROBOTS}")
    return int(text)


def _make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="nena-demo",
        description="Starts NeNa on this machine with simulated robots that carry out transport orders.",
    )
    parser.add_argument("-V", "--version", action=ShowVersion, program=parser.prog)
    parser.add_argument(
        "command",
        choices=("run", "smoke"),
        help="run: a hall with a guided tour, until q or Ctrl-C; smoke: two robots carry out two orders; "
        "check the result and stop",
    )
    parser.add_argument(
        "--broker",
        choices=("auto", "mosquitto", "amqtt"),
        default="auto",
        help="MQTT broker to start (default: Mosquitto if installed, else amqtt)",
    )
    parser.add_argument(
        "--time-factor", type=float, help="speed-up of the ROS robots (default: run 1, smoke 5)"
    )
    parser.add_argument(
        "--robots",
        type=_number_of_robots,
        default=Options().robots,
        help=f"run: loopback robots, 1 to {MOST_ROBOTS} (default 10); ROS installations add two ROS robots",
    )
    parser.add_argument(
        "--domain-id",
        type=int,
        default=Options().domain_id,
        help="ROS domain of the robots (default: random)",
    )
    parser.add_argument(
        "--separate-domains", action="store_true", help="use the next ROS domain for the second robot"
    )
    parser.add_argument(
        "--panel-port", type=int, default=0, help="port of the control panel (default: a free one)"
    )
    parser.add_argument(
        "--rest-port", type=int, default=0, help="port of the order service (default: a free one)"
    )
    parser.add_argument("--keep-logs", type=Path, help="folder for all logs if the run fails")
    return parser


if __name__ == "__main__":
    sys.exit(main())
