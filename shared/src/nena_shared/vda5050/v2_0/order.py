"""The order message of 2.0 (section 6.7)."""

from __future__ import annotations

from nena_shared.vda5050.v2_1.order import EdgeV21, OrderV21
from nena_shared.vda5050.wire_names import Absent


class EdgeV20(EdgeV21):
    """The way between two nodes; 2.0 knows no corridors."""

    corridor: Absent = None


class OrderV20(OrderV21):
    """A graph of nodes and edges to drive."""

    edges: tuple[EdgeV20, ...]
