"""A mission: what one robot is to do now, as one VDA 5050 order."""

from __future__ import annotations

from functools import cached_property
from typing import Self

from nena_shared.vda5050.action import Action
from nena_shared.vda5050.base import Identifier, WireObject
from nena_shared.vda5050.order import Edge, Node


class Mission(WireObject):
    """One drive order as a VDA 5050 order graph, all of it released.

    It is made once and then sent unchanged as often as needed, so whoever has to take it up again after a
    restart keeps its JSON: the ids of its actions must stay the same.
    """

    mission_id: Identifier
    """The orderId on the wire."""
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]

    @classmethod
    def from_json(cls, text: str | bytes) -> Self:
        """Read what :meth:`to_json` wrote. Raises pydantic's ValidationError for anything else."""
        return cls.model_validate_json(text)

    def to_json(self) -> str:
        """Write the mission so that :meth:`from_json` gives an equal one."""
        return self.model_dump_json(by_alias=True, exclude_none=True)

    @cached_property
    def actions(self) -> tuple[Action, ...]:
        """All actions of the mission, in the order in which the robot meets them."""
        return tuple(action for node in self.nodes for action in node.actions)

    @cached_property
    def action_ids(self) -> frozenset[str]:
        """The ids of all actions of the mission."""
        return frozenset(action.action_id for action in self.actions)

    @property
    def last_sequence_id(self) -> int:
        """The sequenceId of the last node: where the mission ends."""
        return self.nodes[-1].sequence_id
