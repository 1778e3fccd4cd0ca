"""Write the orders and order updates of one robot, each node and edge once."""

from __future__ import annotations

from itertools import pairwise
from typing import Final

from msgspec import Raw
from msgspec.json import Decoder, Encoder

from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.order import Order

_MEMBERS: Final[Decoder[dict[str, Raw]]] = Decoder(dict[str, Raw])
_PARTS: Final[Decoder[list[Raw]]] = Decoder(list[Raw])
_ENCODER: Final = Encoder()


class OrderWriter:
    """Encodes orders as their codec does.

    An update repeats most nodes and edges of the one before (section 6.1.2), so their texts are kept: writing
    them again took about a seventh of the CPU time that a driving robot costs the order service.
    """

    def __init__(self) -> None:
        self._codec: Codec | None = None
        self._last: Order | None = None
        self._text = b""
        """The text of the last order."""

    def encode(self, order: Order, codec: Codec) -> bytes:
        """Encode an order; raises as :meth:`Codec.encode`."""
        codec.check(order)
        last = self._last if codec is self._codec else None
        text = self._updated(order, last, codec) if last and _repeats(order, last) else codec.write(order)
        self._codec, self._last, self._text = codec, order, text
        return text

    def _updated(self, order: Order, last: Order, codec: Codec) -> bytes:
        """Encode an order of which parts are known from the last one."""
        members = _MEMBERS.decode(self._text)
        nodes = dict(zip(map(id, last.nodes), _PARTS.decode(members["nodes"]), strict=True))
        edges = dict(zip(_identities(last), _PARTS.decode(members["edges"]), strict=True))
        identities = _identities(order)
        new = [index for index, node in enumerate(order.nodes) if id(node) not in nodes]
        for index, identity in enumerate(identities):
            if identity not in edges:
                new += (index, index + 1)
        # the smallest range of nodes with all new ones and the ends of new edges; at least one
        begin, end = (min(new), max(new) + 1) if new else (0, 1)
        part = {"nodes": order.nodes[begin:end], "edges": order.edges[begin : end - 1]}
        members = _MEMBERS.decode(codec.write(order.model_copy(update=part)))
        written = {
            "nodes": [
                *(nodes[id(each)] for each in order.nodes[:begin]),
                *_PARTS.decode(members["nodes"]),
                *(nodes[id(each)] for each in order.nodes[end:]),
            ],
            "edges": [
                *(edges[each] for each in identities[:begin]),
                *_PARTS.decode(members["edges"]),
                *(edges[each] for each in identities[end - 1 :]),
            ],
        }
        return _ENCODER.encode({**members, **written})


def _repeats(order: Order, last: Order) -> bool:
    """Return whether an order has a node of the last one."""
    return not set(map(id, last.nodes)).isdisjoint(map(id, order.nodes))


def _identities(order: Order) -> list[tuple[int, str, str]]:
    """Return the identity of each edge, and the IDs of its nodes, which some versions write with it."""
    return [
        (id(edge), before.node_id, after.node_id)
        for edge, (before, after) in zip(order.edges, pairwise(order.nodes), strict=True)
    ]
