"""The robot's pose along the transforms of its frames."""

from __future__ import annotations

import math

import pytest

from nena_edge_agent.nav2.transforms import MOST_FRAMES, Chain, Transform

MAP_ODOM = Transform("map", "odom", 10.0, 0.0, math.pi / 2, 5)
ODOM_FOOT = Transform("odom", "base_footprint", 2.0, 0.0, 0.0, 7)
FOOT_BASE = Transform("base_footprint", "base_link", 0.1, 0.0, 0.0, 0)


@pytest.fixture
def chain() -> Chain:
    made = Chain("map", "base_link", timeout=2.0)
    made.put((FOOT_BASE,), math.inf)
    return made


def test_the_robot_is_where_the_transforms_lead(chain: Chain) -> None:
    chain.put((MAP_ODOM, ODOM_FOOT), 0.0)
    pose = chain.pose(1.0)
    assert pose is not None
    assert (pose.x, pose.y, pose.yaw) == pytest.approx((10.0, 2.1, math.pi / 2))
    assert (pose.frame, pose.stamp) == ("map", 7)


def test_frames_that_are_never_sent_again_are_dropped(chain: Chain) -> None:
    for number in range(3 * MOST_FRAMES):
        chain.put((Transform("map", f"tag {number}", 1.0, 0.0, 0.0, 0),), float(number))
    chain.put((MAP_ODOM, ODOM_FOOT), 3.0 * MOST_FRAMES)

    assert len(chain._known) <= MOST_FRAMES + 2
    assert chain.pose(3.0 * MOST_FRAMES) is not None


@pytest.mark.parametrize(
    ("known", "missing"),
    [
        ((MAP_ODOM,), "from the frame map to base_footprint"),
        ((ODOM_FOOT,), "from the frame map to odom"),
    ],
)
def test_a_missing_transform_is_named(chain: Chain, known: tuple[Transform, ...], missing: str) -> None:
    chain.put(known, 0.0)
    assert chain.pose(0.0) is None
    assert missing in chain.missing


def test_a_missing_transform_makes_the_pose_unknown(chain: Chain) -> None:
    chain.put((MAP_ODOM, ODOM_FOOT), 0.0)
    chain.put((ODOM_FOOT,), 2.5)
    assert chain.pose(2.5) is None
    chain.put((MAP_ODOM,), 2.6)
    assert chain.pose(2.6) is not None
    assert chain.missing == ""


def test_frames_in_a_circle_lead_nowhere() -> None:
    chain = Chain("map", "base_link", timeout=2.0)
    chain.put((Transform("a", "base_link", 0, 0, 0, 0), Transform("base_link", "a", 0, 0, 0, 0)), 0.0)
    assert chain.pose(0.0) is None


def test_only_transforms_that_may_move_the_robot_are_reported(chain: Chain) -> None:
    assert not chain.put((Transform("base_link", "wheel", 0, 0, 0, 0),), 0.0)
    assert chain.put((MAP_ODOM,), 0.0)
