"""What the doctor concludes from what it saw; that it sees it is shown over DDS elsewhere."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from nena_edge_agent.doctor.finding import Link, LinkFinding, LinkVerdict
from nena_edge_agent.doctor.navigation import (
    ROS_LINKS,
    Grid,
    RosView,
    judge_clock,
    judge_map,
    judge_robot,
    kernel_keeps_time,
)
from nena_edge_agent.nav2.poses import PoseReading
from nena_edge_agent.nav2.presence import Lifecycle
from nena_edge_agent.nav2.settings import OfferSettings, RosSettings

SETTINGS = RosSettings(namespace="r1", domain_id=42)
POSE = PoseReading(1.0, 2.0, 0.5, "map", 0, 0.04, 0.01, 0.01)
WELL = RosView(
    nodes=("/r1/bt_navigator",),
    servers=1,
    goal_listeners=1,
    lifecycle=Lifecycle.ACTIVE,
    pose=POSE,
    grid=Grid("map", -10.0, -10.0, 50.0, 30.0),
    clock_offset=0.0,
)


def first_missing(view: RosView) -> LinkFinding:
    return next(each for each in judge_robot(view, SETTINGS) if each.verdict is LinkVerdict.MISSING)


def test_a_healthy_robot() -> None:
    findings = judge_robot(WELL, SETTINGS)

    assert [each.link for each in findings] == list(ROS_LINKS)
    assert {each.verdict for each in findings} == {LinkVerdict.OK}
    (place,) = (each.text for each in findings if each.link is Link.LOCALISATION)
    assert place == "the robot is at 1.00 m, 2.00 m, 29 degrees, ± 0.20 m and 6 degrees"


def test_a_keep_out_mask_that_nobody_uses_is_doubtful() -> None:
    findings = judge_robot(replace(WELL, unused_mask="no node subscribes to /r1/zone_filter_info"), SETTINGS)

    (nav2,) = (each for each in findings if each.link is Link.NAVIGATION)
    assert nav2.verdict is LinkVerdict.DOUBTFUL
    assert "drives through BLOCKED zones: no node subscribes to /r1/zone_filter_info" in nav2.text
    assert "docs/nav2.md" in nav2.remedy


@pytest.mark.parametrize("lifecycle", [Lifecycle.INACTIVE, Lifecycle.SILENT])
def test_a_missing_pose_is_reported_before_an_inactive_nav2(lifecycle: Lifecycle) -> None:
    findings = judge_robot(replace(WELL, lifecycle=lifecycle, pose=None), SETTINGS)

    lacks = [each for each in findings if each.verdict is LinkVerdict.MISSING]
    assert [each.link for each in lacks] == [Link.LOCALISATION, Link.NAVIGATION]
    assert "gives up after waiting 60 s" in lacks[1].remedy
    assert "activate it" not in lacks[1].remedy


@pytest.mark.parametrize(
    ("view", "link", "text", "remedy"),
    [
        (RosView(), Link.DOMAIN, "domain 42", "UDP multicast"),
        (RosView(busy_domains=(0, 7)), Link.DOMAIN, "nodes are visible in 0, 7", "ros.domain_id"),
        (replace(WELL, servers=0), Link.NAMESPACE, "namespace /r1", "start Nav2"),
        (replace(WELL, servers=0, elsewhere=("/", "/r2")), Link.NAMESPACE, "in /, /r2", "ros.namespace"),
        (replace(WELL, lifecycle=Lifecycle.INACTIVE), Link.NAVIGATION, "not active", "autostart"),
        (replace(WELL, lifecycle=Lifecycle.SILENT), Link.NAVIGATION, "does not answer", "restart it"),
        (replace(WELL, goal_listeners=0), Link.NAVIGATION, "goal_pose", "bt_navigator"),
        (replace(WELL, pose=None), Link.LOCALISATION, "amcl_pose", "initial position"),
        (replace(WELL, pose=replace(POSE, frame="earth")), Link.LOCALISATION, "'earth'", "ros.frame"),
        (replace(WELL, pose=replace(POSE, x_variance=4.0)), Link.LOCALISATION, "2.00 m", "initial position"),
        (
            replace(WELL, pose=replace(POSE, y_variance=math.nan)),
            Link.LOCALISATION,
            "invalid variances",
            "initial",
        ),
    ],
)
def test_a_missing_link_is_named_with_a_remedy(view: RosView, link: Link, text: str, remedy: str) -> None:
    finding = first_missing(view)

    assert finding.link is link
    assert text in finding.text
    assert remedy in finding.remedy


@pytest.mark.parametrize(
    ("view", "text", "remedy"),
    [
        (WELL, "no node has the action follow_path", "ros.names.follow_path"),
        (replace(WELL, path_servers=1, path_types=False), "nav2_msgs cannot be loaded", "source"),
    ],
)
def test_a_robot_that_cannot_follow_paths_is_doubtful(view: RosView, text: str, remedy: str) -> None:
    settings = SETTINGS.model_copy(update={"nav2": OfferSettings(follow_path=True)})
    finding = judge_robot(view, settings)[-1]

    assert (finding.link, finding.verdict) == (Link.NAVIGATION, LinkVerdict.DOUBTFUL)
    assert text in finding.text
    assert remedy in finding.remedy
    able = replace(WELL, path_servers=1)
    assert {each.verdict for each in judge_robot(able, settings)} == {LinkVerdict.OK}


def test_checks_that_depend_on_a_missing_link_are_skipped() -> None:
    without_nodes, without_nav2 = (
        judge_robot(RosView(), SETTINGS),
        judge_robot(replace(WELL, servers=0), SETTINGS),
    )

    unknown, ok, gone = LinkVerdict.UNKNOWN, LinkVerdict.OK, LinkVerdict.MISSING
    assert [each.verdict for each in without_nodes] == [gone, unknown, unknown, unknown]
    assert [each.verdict for each in without_nav2] == [ok, gone, unknown, unknown]
    assert [each.link for each in without_nodes] == list(ROS_LINKS)


def test_nav2_without_a_lifecycle_manager_counts_as_active() -> None:
    (finding,) = [
        each
        for each in judge_robot(replace(WELL, lifecycle=Lifecycle.ABSENT), SETTINGS)
        if each.link is Link.NAVIGATION
    ]

    assert finding.verdict is LinkVerdict.OK


@pytest.mark.parametrize(
    ("view", "plant_maps", "verdict", "text"),
    [
        (WELL, set(), LinkVerdict.OK, "orders must use this name; Nav2's map is 50 m by 30 m"),
        (WELL, {"hall", "yard"}, LinkVerdict.OK, "as in the plant model"),
        (WELL, {"yard", "Hall"}, LinkVerdict.MISSING, "the plant model has 'Hall', 'yard'"),
        (None, {"yard"}, LinkVerdict.MISSING, "the plant model has 'yard'"),
        (None, set(), LinkVerdict.OK, "map_id is 'hall', orders must use this name"),
        (RosView(), set(), LinkVerdict.UNKNOWN, "more needs the namespace"),
        (replace(WELL, grid=None), set(), LinkVerdict.DOUBTFUL, "no node publishes a map"),
        (replace(WELL, grid=replace(WELL.grid, frame="odom")), set(), LinkVerdict.MISSING, "frame 'odom'"),  # type: ignore[type-var]  # it is no None
        (replace(WELL, pose=replace(POSE, x=40.1)), set(), LinkVerdict.MISSING, "not on Nav2's map"),
        (replace(WELL, pose=replace(POSE, y=-10.1)), set(), LinkVerdict.MISSING, "not on Nav2's map"),
        (replace(WELL, pose=None), set(), LinkVerdict.OK, "50 m by 30 m"),
    ],
)
def test_map_findings(view: RosView | None, plant_maps: set[str], verdict: LinkVerdict, text: str) -> None:
    finding = judge_map(view, SETTINGS, "hall", plant_maps)

    assert finding.verdict is verdict
    assert text in finding.text


@pytest.mark.parametrize(
    ("kept", "offset", "verdict"),
    [
        (True, 0.01, LinkVerdict.OK),
        (True, None, LinkVerdict.OK),
        (None, -1.9, LinkVerdict.OK),
        (False, 0.0, LinkVerdict.DOUBTFUL),
        (False, None, LinkVerdict.DOUBTFUL),
        (True, 2.1, LinkVerdict.MISSING),
        (False, -1_795_000_000.0, LinkVerdict.MISSING),
    ],
)
def test_wrong_stamps_take_precedence_over_the_kernels_clock_status(
    *, kept: bool | None, offset: float | None, verdict: LinkVerdict
) -> None:
    assert judge_clock(kept=kept, ros_offset=offset).verdict is verdict


def test_simulated_time_is_suggested_as_a_cause() -> None:
    assert "use_sim_time" in judge_clock(kept=True, ros_offset=-1_795_000_000.0).remedy


def test_the_kernels_clock_status_is_read() -> None:
    assert kernel_keeps_time() in (True, False)
