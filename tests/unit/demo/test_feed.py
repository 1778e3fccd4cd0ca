from __future__ import annotations

import json
from collections import Counter

import httpx
import pytest

from nena_demo.feed import OrderFeed
from nena_demo.host import Host
from nena_demo.plants.hall import Hall, make_hall
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.settings import MqttSettings
from support.fleet_examples import order_status

HALL = make_hall(tuple(f"AMR-{number}" for number in range(12)))


def made_feed(handler: httpx.MockTransport, hall: Hall = HALL) -> OrderFeed:
    host = Host(MqttSettings(), "http://nena.test", lambda *_: None)
    host.rest = httpx.AsyncClient(base_url="http://nena.test", transport=handler)
    return OrderFeed(host, hall)


def accepting(asked: list[dict[str, object]], *, refused: int = 0) -> httpx.MockTransport:
    """Return an order service that creates all orders of a batch but the first ``refused``."""

    def answer(request: httpx.Request) -> httpx.Response:
        orders = json.loads(request.content)["transportOrders"]
        asked.extend(orders)
        results = [
            {
                "status": 201,
                "transportOrder": order_status(order["name"]).model_dump(mode="json", by_alias=True),
            }
            for order in orders[refused:]
        ]
        return httpx.Response(200, json={"results": [{"status": 503}] * refused + results})

    return httpx.MockTransport(answer)


async def test_peak_has_three_orders_for_each_robot_from_goods_in_and_to_goods_out() -> None:
    asked: list[dict[str, object]] = []
    feed = made_feed(accepting(asked))

    assert await feed.peak() == 36
    assert len(feed.open) == len({each["name"] for each in asked}) == 36
    stations = Counter(
        stop["locationName"].rstrip(" 0123456789")
        for each in asked
        for stop in each["destinations"]  # type: ignore[attr-defined]
    )
    assert stations == {"Goods in": 18, "Storage": 36, "Goods out": 18}


async def test_orders_of_a_large_hall_stay_in_a_section() -> None:
    large = make_hall(tuple(f"AMR-{number}" for number in range(52)))
    asked: list[dict[str, object]] = []
    feed = made_feed(accepting(asked), large)
    await feed.peak()
    sections = [{*each.goods_in, *each.storage, *each.goods_out} for each in large.sections]
    for order in asked:
        stops = {stop["locationName"] for stop in order["destinations"]}  # type: ignore[attr-defined]
        assert any(stops <= each for each in sections)


async def test_orders_that_were_not_created_are_not_open() -> None:
    assert await (feed := made_feed(accepting([], refused=6))).peak() == 30
    assert len(feed.open) == 30


@pytest.mark.parametrize("error", [httpx.ConnectError("refused"), httpx.ReadTimeout("late")])
async def test_no_order_is_open_without_an_order_service(error: httpx.HTTPError) -> None:
    def answer(_: httpx.Request) -> httpx.Response:
        raise error

    assert await (feed := made_feed(httpx.MockTransport(answer))).peak() == 0
    assert not feed.open


async def test_ended_orders_are_counted_by_their_state() -> None:
    feed = made_feed(accepting([]))
    await feed.peak()
    first, second, *_ = sorted(feed.open)

    feed.changed(first, TransportOrderState.BEING_PROCESSED)
    feed.changed(first, TransportOrderState.FINISHED)
    feed.changed(second, TransportOrderState.FAILED)
    feed.changed("another", TransportOrderState.FAILED)

    assert feed.ended == {TransportOrderState.FINISHED: 1, TransportOrderState.FAILED: 1}
    assert len(feed.open) == 34
