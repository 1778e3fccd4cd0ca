"""The doctor and a simulated robot, over DDS: each link of the robot's side, missing and there."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from nav_msgs.msg import Odometry

from nena_edge_agent.doctor.finding import Link, LinkFinding, LinkVerdict
from nena_edge_agent.doctor.navigation import RosView, judge_clock, judge_map, judge_robot
from nena_edge_agent.doctor.program import examine
from nena_edge_agent.doctor.ros_probe import _Probe, observe_robot
from nena_edge_agent.nav2.session_control import SessionStore
from nena_edge_agent.nav2.settings import RosAddress, RosNames, RosSettings
from nena_shared.vda5050.topics import RobotKey
from support.action_types import needs_nav2_types
from support.broker import Broker
from support.edge_agent import agent_settings
from support.ros import BEST_EFFORT, LATCHED, RosPeer
from support.simulator import simulated_robot
from support.waiting import PATIENCE

pytestmark = pytest.mark.ros

OK, MISSING = LinkVerdict.OK, LinkVerdict.MISSING


PROBE = "nena_edge_agent.doctor.ros_probe"
CALLS = 30.0
"""Seconds that a service has to answer."""


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait long enough that everything present is found, also on slow machines."""
    monkeypatch.setattr(f"{PROBE}.LOOK_FOR", PATIENCE)
    monkeypatch.setattr(f"{PROBE}.LOOK_ELSEWHERE", 6.0)
    monkeypatch.setattr(f"{PROBE}.POSE_WAIT", 0.5)


def expect(monkeypatch: pytest.MonkeyPatch, enough: Callable[[_Probe], object]) -> None:
    """End the observation once ``enough`` is seen; waiting for the missing parts would be pointless."""
    monkeypatch.setattr(_Probe, "_is_complete", enough)


def first_missing(view: RosView, settings: RosSettings) -> LinkFinding:
    return next(each for each in judge_robot(view, settings) if each.verdict is MISSING)


async def test_healthy_robot(domain_id: int) -> None:
    settings = RosSettings(namespace="r1", domain_id=domain_id, call_timeout=CALLS)
    with simulated_robot(domain_id, "r1"):
        view = await observe_robot(settings)

    assert {each.verdict for each in judge_robot(view, settings)} == {OK}
    assert view.path_servers == 1
    assert judge_map(view, settings, "hall", {"hall"}).verdict is OK
    assert view.grid is not None
    assert (view.grid.width, view.grid.height) == pytest.approx((60, 60), abs=1)
    assert view.clock_offset is not None
    assert judge_clock(kept=True, ros_offset=view.clock_offset).verdict is OK


@needs_nav2_types
async def test_keep_out_filter_with_a_relative_name(domain_id: int, monkeypatch: pytest.MonkeyPatch) -> None:
    from nav2_msgs.msg import CostmapFilterInfo  # noqa: PLC0415 - not everywhere

    names = RosNames(zone_filter_info="my_zones")
    settings = RosSettings(namespace="r1", domain_id=domain_id, names=names, call_timeout=CALLS)
    with (
        simulated_robot(domain_id, "r1"),
        RosPeer(domain_id, "/r1/global_costmap", "global_costmap") as costmap,
    ):
        costmap.subscribe(CostmapFilterInfo, "my_zones", LATCHED)
        expect(monkeypatch, lambda probe: probe._unused_mask() and probe._goals.get_subscription_count())
        view = await observe_robot(settings)

    assert view.unused_mask.startswith("no node subscribes to /r1/my_zones")
    assert view.unused_mask.endswith("now it is /r1/global_costmap/my_zones")


async def test_robot_in_the_domain_of_the_environment(
    domain_id: int, other_domain_id: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain_id))
    monkeypatch.setattr(f"{PROBE}.LOOK_FOR", 0.5)  # there is nobody
    settings = RosSettings(domain_id=other_domain_id)
    with simulated_robot(domain_id):
        view = await observe_robot(settings)

    finding = first_missing(view, settings)
    assert finding.link is Link.DOMAIN
    assert domain_id in view.busy_domains


@pytest.mark.broker
async def test_moved_agent_is_found_in_its_current_session(
    broker: Broker, interface_name: str, domain_id: int, tmp_path: Path
) -> None:
    settings = agent_settings(
        broker,
        interface_name,
        tmp_path,
        driver="nav2",
        ros={"namespace": "r2", "domain_id": domain_id, "call_timeout": CALLS},
    )
    robot = RobotKey(settings.manufacturer, settings.serial_number)
    SessionStore(tmp_path, robot).write(RosAddress("/r1", domain_id), settings.ros)
    with simulated_robot(domain_id, "r1"):
        findings = await examine(settings)
    (namespace,) = (each for each in findings if each.link is Link.NAMESPACE)
    assert namespace.verdict is OK


async def test_robot_in_another_namespace(domain_id: int, monkeypatch: pytest.MonkeyPatch) -> None:
    expect(monkeypatch, lambda probe: probe._statuses_elsewhere())
    settings = RosSettings(namespace="r2", domain_id=domain_id)
    with simulated_robot(domain_id, "r1"):
        view = await observe_robot(settings)

    finding = first_missing(view, settings)
    assert finding.link is Link.NAMESPACE
    assert "but one does in /r1" in finding.text


async def test_domain_without_nav2(domain_id: int, peer: RosPeer, monkeypatch: pytest.MonkeyPatch) -> None:
    expect(monkeypatch, lambda probe: probe._node_names())
    settings = RosSettings(domain_id=domain_id)

    view = await observe_robot(settings)

    assert view.nodes == ("/test_peer",)
    assert first_missing(view, settings).link is Link.NAMESPACE
    assert peer.node.get_name() == "test_peer"


async def test_inactive_nav2(domain_id: int) -> None:
    settings = RosSettings(domain_id=domain_id, call_timeout=CALLS)
    with simulated_robot(domain_id, faults=({"kind": "inactive"},)):
        view = await observe_robot(settings)

    assert first_missing(view, settings).link is Link.NAVIGATION


async def test_robot_that_is_not_localised(domain_id: int, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = RosSettings(domain_id=domain_id, call_timeout=CALLS)
    expect(
        monkeypatch,
        lambda probe: (
            probe._count_servers()
            and probe._grid
            and probe._lifecycle.service_is_ready()
            and probe._goals.get_subscription_count()
            and probe._fresh_pose.service_is_ready()
        ),
    )
    with simulated_robot(domain_id, localisation={"known_at_start": False}):
        view = await observe_robot(settings)

    finding = first_missing(view, settings)
    assert finding.link is Link.LOCALISATION
    assert "no poses on amcl_pose" in finding.text


async def test_uncertain_localisation(domain_id: int) -> None:
    settings = RosSettings(domain_id=domain_id, call_timeout=CALLS)
    with simulated_robot(domain_id, localisation={"xy_deviation": 3.0}):
        view = await observe_robot(settings)

    assert "is uncertain" in first_missing(view, settings).text


async def test_another_frame(domain_id: int) -> None:
    settings = RosSettings(domain_id=domain_id, frame="earth", call_timeout=CALLS)
    with simulated_robot(domain_id):
        view = await observe_robot(settings)

    assert first_missing(view, settings).link is Link.LOCALISATION
    assert "frame 'map'" in judge_map(view, settings, "hall", ()).text


async def test_simulated_time(domain_id: int, peer: RosPeer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Publish odometry with other stamps than the simulator's."""
    expect(monkeypatch, lambda probe: probe._clock_offset)
    settings = RosSettings(domain_id=domain_id, namespace="r1")
    odometry = peer.node.create_publisher(Odometry, "/r1/odom", BEST_EFFORT)
    peer.node.create_timer(0.05, lambda: odometry.publish(Odometry()))

    view = await observe_robot(settings)

    finding = judge_clock(kept=True, ros_offset=view.clock_offset)
    assert finding.verdict is MISSING
    assert "use_sim_time" in finding.remedy


@pytest.mark.broker
@pytest.mark.e2e
def test_the_command(broker: Broker, domain_id: int) -> None:
    program = str(Path(sys.executable).with_name("nena-edge-agent"))
    options = ["--mqtt.port", str(broker.port), "--ros.domain_id", str(domain_id), "--ros.namespace", "r1"]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("NENA_")}
    with simulated_robot(domain_id, "r1"):
        done = subprocess.run(
            [program, "doctor", *options],
            capture_output=True,
            text=True,
            timeout=PATIENCE,
            env=environment,
            check=False,
        )

    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.endswith("No link is missing.\n")
    assert [line.split()[0] for line in done.stdout.splitlines()[:8]] == ["ok"] * 8


async def test_nav2_parameters_are_reported(domain_id: int) -> None:
    settings = RosSettings(domain_id=domain_id, call_timeout=CALLS)
    with simulated_robot(domain_id, tolerance={"xy": 0.15, "yaw": 0.2}):
        view = await observe_robot(settings)

    assert (view.tolerance, view.theta_tolerance, view.server_timeout) == (0.15, 0.2, 20)
    (nav2,) = (each for each in judge_robot(view, settings) if each.link is Link.NAVIGATION)
    assert "goal tolerance 0.15 m" in nav2.text
    assert "heading tolerance 0.2 rad" in nav2.text
    assert "waits 20 ms" in nav2.text
