"""Write the orders and order updates of one robot, each node and edge once."""

from __future__ import annotations

from itertools import pairwise
from typing import Final

from msgspec import Raw
from msgspec.json import Decoder, Encoder

from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.order import Edge, Node, Order

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
        self._nodes: dict[int, tuple[Node, Raw]] = {}
        """By the identity of a node in the last message: the node and its text."""
        self._edges: dict[int, tuple[Edge, str, str, Raw]] = {}
        """By the identity of an edge in the last message: the edge, the IDs of its nodes, and its text."""

    def encode(self, order: Order, codec: Codec) -> bytes:
        """Encode an order; raises as :meth:`Codec.encode`."""
        codec.check(order)
        if codec is not self._codec:
            self._codec, self._nodes, self._edges = codec, {}, {}
        begin, end = self._new_part(order)
        new = {"nodes": order.nodes[begin:end], "edges": order.edges[begin : end - 1]}
        members = _MEMBERS.decode(codec.write(order.model_copy(update=new)))
        nodes = [
            *(self._nodes[id(each)][1] for each in order.nodes[:begin]),
            *_PARTS.decode(members["nodes"]),
            *(self._nodes[id(each)][1] for each in order.nodes[end:]),
        ]
        edges = [
            *(self._edges[id(each)][3] for each in order.edges[:begin]),
            *_PARTS.decode(members["edges"]),
            *(self._edges[id(each)][3] for each in order.edges[end - 1 :]),
        ]
        self._nodes = {id(node): (node, text) for node, text in zip(order.nodes, nodes, strict=True)}
        self._edges = {
            id(edge): (edge, before.node_id, after.node_id, text)
            for edge, (before, after), text in zip(order.edges, pairwise(order.nodes), edges, strict=True)
        }
        return _ENCODER.encode({**members, "nodes": nodes, "edges": edges})

    def _new_part(self, order: Order) -> tuple[int, int]:
        """Return the smallest range of nodes with all new nodes and the ends of new edges; at least one."""
        new = [index for index, node in enumerate(order.nodes) if id(node) not in self._nodes]
        for index, (edge, ends) in enumerate(zip(order.edges, pairwise(order.nodes), strict=True)):
            known = self._edges.get(id(edge))
            if known is None or known[1:3] != (ends[0].node_id, ends[1].node_id):
                new += (index, index + 1)
        return (min(new), max(new) + 1) if new else (0, 1)
