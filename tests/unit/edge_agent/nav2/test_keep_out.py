"""The mask of areas that the robot must not enter."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Sequence
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_edge_agent.driver.port import Area
from nena_edge_agent.nav2 import keep_out
from nena_edge_agent.nav2.keep_out import CLOSED, NOTHING, KeepOutMask, Mask, mask_of, unused_mask
from nena_edge_agent.nav2.settings import RosNames, RosSettings
from support.waiting import PATIENCE

SQUARE = ((1.0, 1.0), (3.0, 1.0), (3.0, 2.0), (1.0, 2.0))


def closed(mask: Mask, x: float, y: float) -> bool:
    """Return whether a place is in a closed cell."""
    column, row = int((x - mask.x) // mask.resolution), int((y - mask.y) // mask.resolution)
    inside = 0 <= column < mask.width and 0 <= row < mask.height
    return inside and mask.cells[row * mask.width + column] == CLOSED


def picture(mask: Mask) -> list[str]:
    rows = [mask.cells[at : at + mask.width] for at in range(0, len(mask.cells), mask.width)]
    return ["".join("#" if cell else "." for cell in row) for row in reversed(rows)]


def test_cells_in_a_polygon_are_closed_and_cells_next_to_it_are_not() -> None:
    mask = mask_of([((0.0, 0.0), (4.0, 0.0), (0.0, 4.0))], 0.5)
    assert picture(mask)[-1] == "#########"
    assert picture(mask)[0] == "#........"
    assert closed(mask, 1.0, 1.0)
    assert not closed(mask, 3.5, 3.5)


def test_several_polygons_share_a_mask() -> None:
    mask = mask_of([SQUARE, ((5.0, 5.0), (6.0, 5.0), (6.0, 6.0))], 0.1)
    assert closed(mask, 2.0, 1.5)
    assert closed(mask, 5.9, 5.5)
    assert not closed(mask, 4.0, 4.0)


def test_an_area_that_is_narrower_than_a_cell_is_closed() -> None:
    mask = mask_of([((0.0, 0.0), (3.0, 0.01), (0.0, 0.02))], 0.5)
    assert all(closed(mask, x, 0.01) for x in (0.1, 1.0, 2.0, 2.9))


def test_no_area_is_an_empty_mask() -> None:
    assert mask_of([], 0.05) == NOTHING
    assert not any(NOTHING.cells)


def test_a_huge_area_has_larger_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keep_out, "CELLS_LIMIT", 1000)
    mask = mask_of([((0.0, 0.0), (500.0, 0.0), (500.0, 500.0), (0.0, 500.0))], 0.05)
    assert len(mask.cells) < 1200
    assert closed(mask, 250.0, 250.0)


@given(st.floats(0.01, 0.99), st.floats(0.01, 0.99), st.sampled_from([0.05, 0.3, 2.0]))
def test_each_cell_inside_is_closed(along: float, up: float, resolution: float) -> None:
    mask = mask_of([SQUARE], resolution)
    assert len(mask.cells) == mask.width * mask.height
    assert closed(mask, 1.0 + 2.0 * along, 1.0 + up)


INFO, MASK = "/r1/zone_filter_info", "/r1/zone_filter_mask"
RVIZ, COSTMAP = ("/", "rviz2"), ("/r1/global_costmap", "global_costmap")


class Graph:
    """A node of the namespace /r1, and the topics to which other nodes (namespace and name) subscribe."""

    def __init__(self, *subscriptions: tuple[str, tuple[str, str]], published: bool = True) -> None:
        self._subscriptions = subscriptions
        self._published = published

    def resolve_topic_name(self, name: str) -> str:
        return name if name.startswith("/") else f"/r1/{name}"

    def get_topic_names_and_types(self) -> list[tuple[str, list[str]]]:
        return [(topic, []) for topic, _ in self._subscriptions]

    def get_subscriptions_info_by_topic(self, topic: str) -> list[SimpleNamespace]:
        found = [node for each, node in self._subscriptions if each == topic]
        return [SimpleNamespace(node_namespace=space, node_name=name) for space, name in found]

    def count_subscribers(self, topic: str) -> int:
        return len(self.get_subscriptions_info_by_topic(topic))

    def count_publishers(self, topic: str) -> int:
        return int(self._published and topic in (INFO, MASK))


@pytest.mark.parametrize(
    "graph",
    [
        Graph((INFO, COSTMAP), (MASK, COSTMAP)),
        Graph(
            (INFO, COSTMAP), (MASK, COSTMAP), ("/r1/local_costmap/zone_filter_info", COSTMAP), (MASK, RVIZ)
        ),
        Graph((INFO, COSTMAP), published=False),  # it does not know the mask's name yet
    ],
)
def test_a_costmap_that_reads_the_mask_and_its_description_uses_it(graph: Graph) -> None:
    assert unused_mask(graph, RosNames(), "agent") == ""


@pytest.mark.parametrize(
    ("graph", "problem"),
    [
        (Graph(), f"no node subscribes to {INFO}; set the costmap's filter_info_topic to this name"),
        (Graph((MASK, RVIZ)), f"no node subscribes to {INFO}"),
        (Graph((INFO, ("/", "agent")), (MASK, ("/", "agent"))), f"no node subscribes to {INFO}"),
        (Graph((INFO, ("/", "_ros2cli_7")), (MASK, ("/", "_ros2cli_7"))), f"no node subscribes to {INFO}"),
        (
            Graph(*((each, ("/", "rosbag2_recorder")) for each in (INFO, MASK))),
            f"no node subscribes to {INFO}",
        ),
        (Graph((INFO, COSTMAP), (MASK, RVIZ)), f"subscribes to {INFO}, but not to the mask {MASK}"),
        (
            Graph(("/r1/global_costmap/zone_filter_info", COSTMAP)),
            "with the leading '/': now it is /r1/global_costmap/zone_filter_info",
        ),
        (
            Graph(("/r2/global_costmap/zone_filter_info", COSTMAP)),
            "set the costmap's filter_info_topic to this",
        ),
    ],
)
def test_a_mask_that_nobody_plans_around_is_told_with_its_cause(graph: Graph, problem: str) -> None:
    assert problem in unused_mask(graph, RosNames(), "agent")


async def test_a_mask_is_drawn_in_a_thread_and_not_published_once_replaced(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    let_draw = threading.Event()

    def draw(polygons: Sequence[object], _: float) -> Mask:
        assert let_draw.wait(PATIENCE), "the event loop waits for the mask"
        return NOTHING if not polygons else Mask(0.0, 0.0, 1.0, 1, 1, b"d")

    monkeypatch.setattr(keep_out, "mask_of", draw)
    mask = KeepOutMask(RosSettings())
    first = asyncio.create_task(mask.show([Area("hall", SQUARE)], "hall"))
    second = asyncio.create_task(mask.show([], "hall"))
    asyncio.get_running_loop().call_soon(let_draw.set)
    await asyncio.gather(first, second)
    assert mask._mask is NOTHING
