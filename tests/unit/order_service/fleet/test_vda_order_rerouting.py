"""A VDA order with another horizon keeps its base, and robots accept it as an update."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.fleet.vda_order import (
    VdaOrder,
    released_to,
    update_of,
    with_kept_base,
    with_other_horizon,
)
from nena_shared.vda5050.action import Action, BlockingType
from nena_shared.vda5050.order import Edge, Node

pytestmark = pytest.mark.clause("6.1.2/fleet")


def vda_order(points: str, action: str, name: str = "T-1-0") -> VdaOrder:
    done = Action(action_type="pick", action_id=action, blocking_type=BlockingType.HARD)
    last = len(points) - 1
    return VdaOrder(
        order_id=name,
        nodes=tuple(
            Node(node_id=each, sequence_id=2 * index, released=True, actions=(done,) * (index == last))
            for index, each in enumerate(points)
        ),
        edges=tuple(
            Edge(edge_id=points[index : index + 2], sequence_id=2 * index + 1, released=True, actions=())
            for index in range(last)
        ),
    )


@given(
    before=st.text("ABCD", min_size=2, max_size=8),
    beyond=st.text("EFGH", min_size=1, max_size=5),
    data=st.data(),
)
def test_the_base_never_changes_and_sequence_ids_continue(
    before: str, beyond: str, data: st.DataObject
) -> None:
    held = vda_order(before, "old")
    base_end = data.draw(st.integers(0, len(before) - 2))

    other = with_other_horizon(held, base_end, vda_order(before[base_end] + beyond, "new"))

    assert other.nodes[: base_end + 1] == held.nodes[: base_end + 1]
    assert other.edges[:base_end] == held.edges[:base_end]
    assert [each.sequence_id for each in other.nodes] == list(range(0, 2 * len(other.nodes), 2))
    assert [each.sequence_id for each in other.edges] == list(range(1, 2 * len(other.edges), 2))
    assert "".join(each.node_id for each in other.nodes) == before[: base_end + 1] + beyond
    assert other.action_ids == {"new"}
    at_robot, wanted = released_to(held, 2 * base_end), released_to(other, 2 * base_end)
    assert with_kept_base(at_robot, wanted) == wanted
    assert update_of(at_robot, wanted).nodes[0] == at_robot.nodes[base_end]


@pytest.mark.parametrize(
    ("tail", "problem"),
    [
        (vda_order("CE", "new"), "does not continue"),
        (vda_order("B", "new"), "does not continue"),
        (vda_order("BE", "old"), "action IDs"),
    ],
)
def test_a_tail_that_does_not_continue_is_refused(tail: VdaOrder, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        with_other_horizon(vda_order("ABCD", "old"), 1, tail)
