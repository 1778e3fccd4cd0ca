"""One robot's conversation with its fleet control, followed message by message: pure, time comes in."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime

from nena_cli.vda5050.action_checks import status_problems
from nena_cli.vda5050.action_ids import ActionIds
from nena_cli.vda5050.base import actions_of
from nena_cli.vda5050.bounded import Remembered
from nena_cli.vda5050.finding import Problem, Rule, Severity
from nena_cli.vda5050.header_checks import HeaderChecks
from nena_cli.vda5050.instant_conversation import InstantConversation
from nena_cli.vda5050.message_checks import message_problems
from nena_cli.vda5050.offer_checks import OfferChecks
from nena_cli.vda5050.order_conversation import OrderConversation
from nena_cli.vda5050.presence_checks import PresenceChecks
from nena_cli.vda5050.said import Said, Speaker
from nena_shared.vda5050.action import InstantActions
from nena_shared.vda5050.base import Header
from nena_shared.vda5050.connection import Connection
from nena_shared.vda5050.factsheet import ActionScope, Factsheet
from nena_shared.vda5050.order import Order
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.state import State


class RobotConversation:
    """What was said so far; a conversation may begin in the middle of an order."""

    def __init__(self) -> None:
        self._headers = HeaderChecks()
        self._presence = PresenceChecks()
        self._offer = OfferChecks()
        self._action_ids = ActionIds()
        self._orders = OrderConversation()
        self._instants = InstantConversation()
        self._requests: Remembered[str, None] = Remembered()
        self._state: State | None = None
        self._cleared: str | None = None
        """The order that the robot had when it was last in a mode that ends it; that may take its time."""

    def check(self, said: Said) -> Iterator[Problem]:
        """Take in the next message, and say what is wrong with it."""
        yield from message_problems(said)
        if said.message is None:
            return
        yield from self._headers.check(said, said.message)
        if said.retained and said.speaker is Speaker.FLEET:
            return  # a command of another time, which robots pass over
        yield from self._content(said, said.message)

    def overdue(self, now: datetime, *, ended: bool = False) -> Iterator[tuple[Said, Problem]]:
        """Name, once, what should have been answered before ``now``, and the silence of a robot.

        ``ended``: the conversation ends here, so that no answer will come.
        """
        yield from self._orders.unanswered(now, ended=ended)
        yield from self._instants.unanswered(now, ended=ended)
        if silence := self._presence.silence(now):
            yield silence

    def _content(self, said: Said, message: Header) -> Iterator[Problem]:
        match message:
            case Order():
                yield from self._order(said, message)
            case InstantActions():
                yield from self._action_ids.check(message.actions, "instantActions")
                yield from self._offer.check(message.actions, ActionScope.INSTANT)
                newest = self._orders.newest
                yield from self._instants.on_instant_actions(said, message, self._state, newest)
            case Responses():
                yield from self._responses(message)
            case State():
                yield from self._take_state(said, message)
            case Connection():
                self._presence.on_connection(message)
            case Factsheet():
                self._offer.on_factsheet(message)

    def _order(self, said: Said, order: Order) -> Iterator[Problem]:
        yield from self._action_ids.check(actions_of(order), f"order '{order.order_id}'")
        yield from self._offer.on_order(order)
        cancelled = self._instants.ends(order.order_id)
        yield from self._orders.on_order(said, order, self._state, cancelled=cancelled)

    def _take_state(self, said: Said, state: State) -> Iterator[Problem]:
        yield from self._presence.on_state(said)
        yield from self._instants.on_state(state)
        if state.operating_mode.clears_order:
            self._cleared = state.order_id
        ends_early = state.order_id == self._cleared or self._instants.ends(state.order_id)
        yield from self._orders.on_state(state, self._state, ends_early=ends_early)
        yield from status_problems(self._state, state)
        for request_id in _request_ids(state):
            self._requests[request_id] = None
        self._state = state

    def _responses(self, message: Responses) -> Iterator[Problem]:
        for each in message.responses:
            if self._state and each.request_id not in self._requests:
                text = f"the robot has not made the request '{each.request_id}'"
                yield Rule.RESPONSE, Severity.WARNING, text


def _request_ids(state: State) -> Iterator[str]:
    yield from (each.request_id for each in state.zone_requests or ())
    yield from (each.request_id for each in state.edge_requests or ())
