from __future__ import annotations

import pytest

from nena_edge_agent.kept_frame import check_frame, frame_of
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.program import StartError
from support.robot_core import Bench, order

TURNED = EdgeAgentSettings(map_transforms={"roof": "x=1", "hall": "rotation=90"})


def test_a_frame_is_named_by_its_transforms() -> None:
    assert frame_of(TURNED) == "hall: rotation=90; roof: x=1"
    assert frame_of(EdgeAgentSettings()) == ""
    assert frame_of(TURNED.model_copy(update={"driver": "loopback"})) == ""


def test_an_order_in_another_frame_is_not_gone_on_with() -> None:
    robot = Bench(frame=frame_of(TURNED))
    robot.send(order("n0", "n1"))
    memory = robot.core.memory()
    check_frame(memory, frame_of(TURNED))
    with pytest.raises(StartError, match="order 'o1' is under way in another frame"):
        check_frame(memory, "")


def test_without_an_order_the_frame_may_change() -> None:
    check_frame(None, frame_of(TURNED))
    check_frame(Bench(frame=frame_of(TURNED)).core.memory(), "")
