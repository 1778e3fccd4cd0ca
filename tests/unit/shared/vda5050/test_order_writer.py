from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import pytest

from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.malformed import MalformedMessageError
from nena_shared.vda5050.order import Edge, Node, NodePosition, Order
from nena_shared.vda5050.order_writer import OrderWriter
from nena_shared.vda5050.versions import CODECS

NODES = tuple(
    Node(
        node_id=f"n{index}",
        sequence_id=2 * index,
        released=False,
        node_position=NodePosition(x=float(index), y=0.5, map_id="hall"),
        actions=(),
    )
    for index in range(10)
)
EDGES = tuple(
    Edge(edge_id=f"e{index}", sequence_id=2 * index + 1, released=False, maximum_speed=1.5, actions=())
    for index in range(9)
)
BASE_NODES = tuple(each.model_copy(update={"released": True}) for each in NODES)
BASE_EDGES = tuple(each.model_copy(update={"released": True}) for each in EDGES)


def update(update_id: int, begin: int, released: int) -> Order:
    """Make the update from node ``begin`` on whose base ends at node ``released``."""
    nodes = (*BASE_NODES[: released + 1], *NODES[released + 1 :])
    edges = (*BASE_EDGES[:released], *EDGES[released:])
    return Order(
        header_id=update_id,
        timestamp=datetime(2026, 11, 27, 9, 30, update_id, tzinfo=UTC),
        version="2.1.0",
        manufacturer="NeNa",
        serial_number="r1",
        order_id="T1",
        order_update_id=update_id,
        nodes=nodes[begin:],
        edges=edges[begin:],
    )


UPDATES = (
    update(0, 0, 2),
    update(1, 2, 3),
    update(1, 2, 3),  # sent again
    update(2, 3, 6),
    update(3, 6, 9),
    update(4, 0, 9),  # nodes before the known ones
)


@pytest.fixture(params=[*CODECS.values()], ids=[*CODECS])
def codec(request: pytest.FixtureRequest) -> Codec:
    found: Codec = request.param
    return found


def test_each_message_is_as_the_codec_writes_it(codec: Codec) -> None:
    writer = OrderWriter()
    for order in UPDATES:
        assert writer.encode(order, codec) == codec.encode(order)


def test_another_version_writes_everything_again() -> None:
    writer = OrderWriter()
    for codec in CODECS.values():
        assert writer.encode(UPDATES[0], codec) == codec.encode(UPDATES[0])


def test_an_edge_between_other_nodes_is_written_again(codec: Codec) -> None:
    writer, order = OrderWriter(), UPDATES[0]
    writer.encode(order, codec)
    renamed = (order.nodes[0], order.nodes[1].model_copy(update={"node_id": "other"}), *order.nodes[2:])
    other = order.model_copy(update={"nodes": renamed})
    assert writer.encode(other, codec) == codec.encode(other)


def test_rules_hold_for_the_whole_order(codec: Codec) -> None:
    writer, order = OrderWriter(), UPDATES[0]
    writer.encode(order, codec)
    with pytest.raises(MalformedMessageError, match="require 9 edges"):
        writer.encode(order.model_copy(update={"edges": order.edges[:-1]}), codec)


def test_the_work_of_an_update_does_not_grow_with_the_route(monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[int] = []
    original = Codec.write

    def counted(codec: Codec, message: Any) -> bytes:
        written.append(len(message.nodes))
        return original(codec, message)

    monkeypatch.setattr(Codec, "write", counted)
    writer = OrderWriter()
    for order in UPDATES[:4]:
        writer.encode(order, CODECS["2.1.0"])
    assert written == [10, 2, 1, 4]


def test_an_order_without_known_parts_is_written_in_one_piece(
    codec: Codec, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: list[bytes] = []
    original = Codec.write

    def kept(codec: Codec, message: Any) -> bytes:
        written.append(original(codec, message))
        return written[-1]

    monkeypatch.setattr(Codec, "write", kept)
    writer = OrderWriter()
    first = writer.encode(update(0, 0, 2), codec)
    nodes = tuple(each.model_copy() for each in BASE_NODES[:2])
    other = update(0, 0, 2).model_copy(update={"nodes": nodes, "edges": BASE_EDGES[:1]})
    assert [first, writer.encode(other, codec)] == written
