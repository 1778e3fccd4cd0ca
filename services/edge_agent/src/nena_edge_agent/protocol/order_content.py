"""What an order said, apart from its header: to know a repeated message again (section 6.1.4.5)."""

from __future__ import annotations

from functools import cached_property
from hashlib import sha256
from typing import Protocol

from nena_shared.vda5050.base import Header, WireObject
from nena_shared.vda5050.order import Order

_HEADER = frozenset(Header.model_fields)


class HeldContent(Protocol):
    """Fingerprints of the order message that was accepted last."""

    @property
    def whole(self) -> str:
        """Of all that it said."""
        ...

    @property
    def decision_node(self) -> str:
        """Of its last released node, with which an update begins."""
        ...


class OrderContent:
    """The fingerprints of one message, taken when they are asked for: most orders never come again."""

    def __init__(self, order: Order) -> None:
        self._order = order

    @cached_property
    def whole(self) -> str:
        """Of all that it said."""
        return fingerprint(self._order)

    @cached_property
    def decision_node(self) -> str:
        """Of its last released node."""
        return fingerprint(next(node for node in reversed(self._order.nodes) if node.released))


def fingerprint(message: WireObject) -> str:
    """Give a text that is the same for all messages that say the same under whatever header."""
    return sha256(message.model_dump_json(exclude=set(_HEADER), exclude_none=True).encode()).hexdigest()
