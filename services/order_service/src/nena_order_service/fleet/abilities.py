"""What a factsheet says that a robot takes (VDA 5050 3.0 section 7.10)."""

from __future__ import annotations

from functools import cached_property
from typing import Final

from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.factsheet import ActionParameterDescription, Factsheet, MobileRobotAction, Support
from nena_shared.vda5050.own_actions import transforms_itself
from nena_shared.vda5050.rules import RULES
from nena_shared.vda5050.versions import nearest_codec

ORDER_PREFIX: Final = "order."
RETRY: Final = "retry"
LISTS: Final = frozenset({"nodes", "edges"})
"""Where paths of an order's optional fields begin when they leave its name out."""


class Abilities:
    """Answers questions about one factsheet.

    A list that is empty is taken as silent, not as a robot that can do nothing.
    """

    def __init__(self, factsheet: Factsheet) -> None:
        self.factsheet = factsheet

    @cached_property
    def required_fields(self) -> tuple[str, ...]:
        """The paths, within an order, of the optional fields that the robot demands."""
        features = self.factsheet.protocol_features
        paths = (each.parameter for each in features.optional_parameters if each.support is Support.REQUIRED)
        return tuple(
            path.removeprefix(ORDER_PREFIX)
            for path in paths
            if path.startswith(ORDER_PREFIX) or path.split(".", 1)[0] in LISTS
        )

    def takes_field(self, path: str) -> bool:
        """Tell whether nothing is known against an optional field, such as ``nodes.nodePosition.theta``."""
        listed = self.factsheet.protocol_features.optional_parameters
        name = path.removeprefix("nodes.")
        return not listed or any(f".{name}." in f".{each.parameter}." for each in listed)

    @cached_property
    def takes_retries(self) -> bool:
        """Whether an action that has failed may be tried again by ``retry``."""
        rules = RULES[self.codec.version] if self.codec else None
        known = rules is not None and ActionStatus.RETRIABLE in rules.action_statuses
        listed = not self.lists_actions or bool(self.declarations(RETRY))
        return known and listed and self.takes_field("nodes.actions.retriable")

    @cached_property
    def codec(self) -> Codec | None:
        """What writes messages for this robot; None for a version that is not spoken here."""
        return nearest_codec(self.factsheet.version)

    @cached_property
    def transforms_itself(self) -> bool:
        """Whether the robot speaks in the plant's frame, whatever its map's is."""
        return transforms_itself(self.factsheet)

    @property
    def lists_actions(self) -> bool:
        """Whether the factsheet says which actions there are."""
        return bool(self.factsheet.protocol_features.mobile_robot_actions)

    def declarations(self, action_type: str) -> tuple[MobileRobotAction, ...]:
        """Give what it says of an action; some robots have an entry for each scope."""
        actions = self.factsheet.protocol_features.mobile_robot_actions
        return tuple(each for each in actions if each.action_type == action_type)

    def parameters(self, action: Action) -> dict[str, ActionParameterDescription]:
        """Give the parameters that it lists for an action, by their key."""
        return {
            parameter.key: parameter
            for each in self.declarations(action.action_type)
            for parameter in each.action_parameters or ()
        }
