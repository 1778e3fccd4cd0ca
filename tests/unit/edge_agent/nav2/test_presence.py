from __future__ import annotations

from types import SimpleNamespace

import pytest

from nena_edge_agent.nav2.presence import (
    DISCOVERY,
    Lifecycle,
    LifecycleWatch,
    PlannerWatch,
    Presence,
    endpoints,
    judge_navigation,
)
from nena_edge_agent.nav2.settings import Navigation, RosSettings

SETTINGS = RosSettings(namespace="r1", domain_id=7)
GID = frozenset({"gid"})


@pytest.mark.parametrize("lifecycle", [Lifecycle.ACTIVE, Lifecycle.ABSENT])
def test_a_nav2_that_accepts_goals(lifecycle: Lifecycle) -> None:
    report = judge_navigation(Presence(GID, 1, lifecycle), SETTINGS, pose_known=True)
    assert report.available
    assert report.reason == ""


@pytest.mark.parametrize(
    ("presence", "pose_known", "reason"),
    [
        (Presence(frozenset(), 0, Lifecycle.ABSENT), False, "is Nav2 running there?"),
        (Presence(GID, 0, Lifecycle.ACTIVE), True, "no node listens to goal_pose"),
        (Presence(GID, 1, Lifecycle.INACTIVE), True, "not active"),
        (Presence(GID, 1, Lifecycle.SILENT), True, "does not answer"),
        (Presence(GID, 1, Lifecycle.STARTING), True, "Nav2 is starting"),
        (Presence(GID, 1, Lifecycle.ACTIVE), False, "no pose received on amcl_pose"),
    ],
)
def test_the_reason_names_what_is_missing(presence: Presence, *, pose_known: bool, reason: str) -> None:
    report = judge_navigation(presence, SETTINGS, pose_known=pose_known)
    assert not report.available
    assert reason in report.reason
    assert "in namespace /r1, domain 7" in report.reason


@pytest.mark.parametrize("lifecycle", [Lifecycle.INACTIVE, Lifecycle.STARTING, Lifecycle.SILENT])
def test_the_initial_position_is_suggested_before_nav2_is_blamed(lifecycle: Lifecycle) -> None:
    report = judge_navigation(Presence(GID, 1, lifecycle), SETTINGS, pose_known=False)
    assert "set the initial position first" in report.reason
    assert "60 s" in report.reason


def test_an_inactive_localisation_prevents_driving() -> None:
    presence = Presence(GID, 1, Lifecycle.ACTIVE, localiser=Lifecycle.INACTIVE)
    assert "amcl/get_state" in judge_navigation(presence, SETTINGS, pose_known=True).reason


def test_only_the_planners_own_node_counts_as_planner() -> None:
    publishers = [
        SimpleNamespace(node_name="planner_server", endpoint_gid=[1, 2]),
        SimpleNamespace(node_name="some_tool", endpoint_gid=[3, 4]),
    ]
    assert endpoints(publishers, node_name="planner_server") == {"0102"}
    assert endpoints(publishers) == {"0102", "0304"}


def test_a_missing_planner_prevents_driving_until_it_returns() -> None:
    watch = PlannerWatch()
    looks = [watch.has_just_gone(publishers) for publishers in (frozenset[str](), GID, frozenset[str]())]
    assert (looks, watch.gone) == ([False, False, True], True), "only one that was present is missed"
    presence = Presence(GID, 1, Lifecycle.ACTIVE, planner_gone=watch.gone)
    assert "is planner_server running?" in judge_navigation(presence, SETTINGS, pose_known=True).reason
    assert not watch.has_just_gone(frozenset())
    assert watch.gone
    assert not watch.has_just_gone(GID)
    assert not watch.gone


def test_the_first_seconds_report_starting() -> None:
    nothing = Presence(frozenset(), 0, Lifecycle.ABSENT)
    report = judge_navigation(nothing, SETTINGS, pose_known=False, seconds=1.0)
    assert (report.available, report.starting) == (False, True)
    assert "just started" in report.reason
    later = judge_navigation(nothing, SETTINGS, pose_known=False, seconds=DISCOVERY)
    assert (later.starting, "is Nav2 running there?" in later.reason) == (False, True)


def test_known_states_are_reported_in_the_first_seconds_too() -> None:
    report = judge_navigation(Presence(GID, 1, Lifecycle.INACTIVE), SETTINGS, pose_known=False, seconds=0.5)
    assert not report.starting
    assert judge_navigation(
        Presence(GID, 1, Lifecycle.ACTIVE), SETTINGS, pose_known=True, seconds=0.5
    ).available


def test_one_missing_response_is_ignored_and_two_are_silence() -> None:
    watch = LifecycleWatch()
    answers: list[bool | None] = [True, None, True, None, None, None, False]
    assert [watch.update(there=True, active=active) for active in answers] == [
        Lifecycle.ACTIVE,
        Lifecycle.ACTIVE,
        Lifecycle.ACTIVE,
        Lifecycle.ACTIVE,
        Lifecycle.SILENT,
        Lifecycle.SILENT,
        Lifecycle.INACTIVE,
    ]


def test_a_service_that_disappears_is_forgotten() -> None:
    watch = LifecycleWatch()
    watch.update(there=True, active=False)
    assert watch.update(there=False, active=None) is Lifecycle.ABSENT
    assert watch.update(there=True, active=None) is Lifecycle.STARTING


def test_a_service_that_never_answered_belongs_to_a_starting_nav2() -> None:
    watch = LifecycleWatch()
    answers: list[bool | None] = [None, None, None, False, True]
    assert [watch.update(there=True, active=active) for active in answers] == [
        *[Lifecycle.STARTING] * 3,
        Lifecycle.INACTIVE,
        Lifecycle.ACTIVE,
    ]


@pytest.mark.parametrize(
    ("navigation", "listeners", "action", "available"),
    [
        ("auto", 1, False, True),
        ("auto", 0, True, True),
        ("auto", 0, False, False),
        ("topics", 1, False, True),
        ("topics", 0, True, False),
        ("action", 0, True, True),
        ("action", 1, False, False),
    ],
)
def test_goals_are_accepted_by_the_configured_interface(
    navigation: Navigation, listeners: int, *, action: bool, available: bool
) -> None:
    settings = RosSettings(namespace="r1", domain_id=7, navigation=Navigation(navigation))
    seen = Presence(GID, listeners, Lifecycle.ACTIVE, action)
    report = judge_navigation(seen, settings, pose_known=True)
    assert report.available is available
    assert ("no node serves the action navigate_to_pose" in report.reason) is (
        navigation == "action" and not action
    )
