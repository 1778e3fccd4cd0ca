"""Fleet control asks a robot only for what its factsheet offers (section 7.10)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from nena_cli.vda5050.finding import Problem, Rule, Severity
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.factsheet import ActionScope, Factsheet
from nena_shared.vda5050.order import Order


class OfferChecks:
    """Knows what the robot's last factsheet offers; before the first one everything passes."""

    def __init__(self) -> None:
        self._scopes: dict[str, tuple[ActionScope, ...]] | None = None

    def on_factsheet(self, message: Factsheet) -> None:
        """Take in what the robot can do."""
        actions = message.protocol_features.mobile_robot_actions
        self._scopes = {each.action_type: tuple(each.action_scopes) for each in actions}

    def on_order(self, order: Order) -> Iterator[Problem]:
        """Check the actions of an order."""
        for node in order.nodes:
            yield from self.check(node.actions, ActionScope.NODE)
        for edge in order.edges:
            yield from self.check(edge.actions, ActionScope.EDGE)

    def check(self, actions: Iterable[Action], scope: ActionScope) -> Iterator[Problem]:
        """Check actions that are asked for in one scope."""
        for action in actions if self._scopes is not None else ():
            offered = (self._scopes or {}).get(action.action_type)
            if offered is None:
                text = f"the factsheet does not offer '{action.action_type}' of action '{action.action_id}'"
                yield Rule.NOT_OFFERED, Severity.WARNING, text
            elif scope not in offered:
                text = f"the factsheet offers '{action.action_type}', but not for {scope}"
                yield Rule.NOT_OFFERED, Severity.WARNING, text
