"""Run the acceptance suite against a running Nav2: ``make nav2-test``."""

from __future__ import annotations

import argparse
import asyncio
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from nav2_acceptance.checks import CHECKS
from nav2_acceptance.report import FAILED, as_json, as_markdown, run
from nav2_acceptance.simulated import simulated_site
from nav2_acceptance.site import Course, Nav2Site, Place
from nena_shared.log import configure
from nena_shared.settings import LogSettings
from support.broker import Broker
from support.nav2_agent import Bench
from support.ros import RosPeer


def main(argv: Sequence[str] | None = None) -> int:
    """Run the checks and write the report; return 1 if one of them has failed."""
    options = _options().parse_args(argv)
    options.output.parent.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        log = stack.enter_context(options.output.with_suffix(".log").open("w", encoding="utf-8"))
        configure(LogSettings(), log)
        if options.simulator:
            place = simulated_site(mqtt_port=options.mqtt_port, domain_id=options.domain)
            site: Nav2Site = stack.enter_context(place)
        else:
            site = _real_site(options, stack)
        site.tell = _tell
        findings = asyncio.run(run(site, options.checks or tuple(CHECKS)))
    options.output.with_suffix(".md").write_text(as_markdown(findings), encoding="utf-8")
    options.output.with_suffix(".json").write_text(as_json(findings), encoding="utf-8")
    sys.stdout.write(as_markdown(findings))
    return int(any(each.verdict == FAILED for each in findings))


def _tell(line: str) -> None:
    """Print the progress as it is made, also into a pipe."""
    print(line, flush=True)  # noqa: T201 - a program


def _real_site(options: argparse.Namespace, stack: ExitStack) -> Nav2Site:
    broker, domain_id = Broker(port=options.mqtt_port), options.domain or 0
    stack.callback(broker.close)
    peer = stack.enter_context(RosPeer(domain_id, options.namespace))
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
    bench = Bench(broker, "nav2", ros=peer, domain_id=domain_id, folder=folder)
    stack.enter_context(bench.mqtt)
    course = Course(
        start=options.start,
        end=options.end,
        beside=options.beside,
        outside=options.outside,
        obstacle=options.obstacle,
        edge=options.edge,
    )
    return Nav2Site(
        bench, course, options.namespace, kill=options.kill, revive=options.revive, pose=options.pose
    )


def _place(text: str) -> Place:
    x, y = text.split(",")
    return float(x), float(y)


def _options() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="make nav2-test", description=__doc__)
    parser.add_argument("--simulator", action="store_true", help="start the robot simulator and test that")
    parser.add_argument(
        "--domain", type=int, default=None, help="ROS domain id; unset: 0, or a free one for the simulator"
    )
    parser.add_argument(
        "--mqtt-port",
        type=int,
        default=None,
        help="TCP port of the broker that is started; unset: a free one",
    )
    parser.add_argument("--namespace", default="/", help="ROS namespace of the robot")
    parser.add_argument(
        "--start", type=_place, default=(0.0, 0.0), help="x,y of one end of a free, straight line"
    )
    parser.add_argument(
        "--end", type=_place, default=(4.0, 0.0), help="x,y of the other end, 4 m away or more"
    )
    parser.add_argument(
        "--pose",
        type=_place,
        default=None,
        help="x,y for the initial position of a robot that is not localised; unset: none is set",
    )
    parser.add_argument("--beside", type=_place, default=(2.0, 1.0), help="x,y of a free position beside it")
    for name, words in (
        ("outside", "outside of the map"),
        ("obstacle", "in an obstacle"),
        ("edge", "at the edge of one"),
    ):
        parser.add_argument(
            f"--{name}", type=_place, default=None, help=f"x,y of an unreachable position {words}"
        )
    parser.add_argument("--kill", default="", help="shell command that kills the process {server}")
    parser.add_argument(
        "--revive",
        default="",
        help="shell command that starts it again; {server} may also be a lifecycle manager, which needs it "
        "when a server of its group was down for over 4 s",
    )
    parser.add_argument("--checks", default="", help="letters of the checks to run, such as abc; unset: all")
    parser.add_argument(
        "--output",
        type=Path,
        default=Path("build/nav2-test"),
        help="path of the reports and the agent's log, without .md, .json and .log",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main())
