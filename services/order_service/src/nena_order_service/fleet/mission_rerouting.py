"""Another way on for a mission under way: its base stays, its horizon is replaced (VDA 5050 3.0 6.1.2)."""

from __future__ import annotations

from nena_order_service.fleet.mission import Mission


def with_other_horizon(held: Mission, base_end: int, tail: Mission) -> Mission:
    """Give ``held`` up to its node ``base_end``, and from there on ``tail``, which begins at that node.

    What the robot was told of the base stays to the last field; the first node of ``tail`` gives only the
    place to go on from. The actions behind the base are those of ``tail``: their ids must be new, for ids are
    not used again after a change of the horizon.

    Raises:
        ValueError: ``tail`` begins elsewhere, has nothing behind its first node, or uses an action id again.

    """
    if tail.nodes[0].node_id != held.nodes[base_end].node_id or not tail.edges:
        message = f"no way on from node {held.nodes[base_end].node_id!r}"
        raise ValueError(message)
    if tail.action_ids & held.action_ids:
        message = "the ids of the actions are those of the old horizon"
        raise ValueError(message)
    shift = 2 * base_end
    nodes = (each.model_copy(update={"sequence_id": each.sequence_id + shift}) for each in tail.nodes[1:])
    edges = (each.model_copy(update={"sequence_id": each.sequence_id + shift}) for each in tail.edges)
    return Mission(
        mission_id=held.mission_id,
        nodes=(*held.nodes[: base_end + 1], *nodes),
        edges=(*held.edges[:base_end], *edges),
    )
