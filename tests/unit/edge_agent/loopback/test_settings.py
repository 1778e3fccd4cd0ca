from __future__ import annotations

from nena_edge_agent.loopback.settings import LoopbackSettings, StartPose


def test_robots_start_in_rows() -> None:
    settings = LoopbackSettings(count=5, row=2, x=1.0, y=10.0, theta=0.5, spacing=3.0)

    places = [(pose.x, pose.y, pose.theta) for pose in map(settings.start, range(5))]
    assert places == [(1, 10, 0.5), (4, 10, 0.5), (1, 13, 0.5), (4, 13, 0.5), (1, 16, 0.5)]


def test_by_default_robots_start_in_one_row() -> None:
    settings = LoopbackSettings(count=3)

    assert [settings.start(index).x for index in range(3)] == [0, 2, 4]
    assert {settings.start(index).y for index in range(3)} == {0}


def test_configured_start_poses_are_used_first() -> None:
    settings = LoopbackSettings(count=2, starts=(StartPose(x=7.0, speed=0.5),))

    assert settings.start(0) == StartPose(x=7.0, speed=0.5)
    assert settings.start(1) == StartPose(x=2.0)
