from __future__ import annotations

from datetime import timedelta

from nena_shared.fleet_api.transport_order import OrderOutcome, TransportOrderState
from nena_shared.histogram import Histogram
from nena_status_aggregator.fleet.statistics import (
    DURATION_BOUNDS,
    LABEL_LENGTH,
    BoundedLabels,
    Statistics,
)
from support.fleet_examples import START, order_status


def test_labels_stay_bounded() -> None:
    labels = BoundedLabels(2, {"known"})
    assert [labels.label_for(each) for each in ("known", "a", "b", "a")] == ["known", "a", "other", "a"]


def test_odd_labels_count_as_other() -> None:
    labels = BoundedLabels(10)
    assert labels.label_for("x" * (LABEL_LENGTH + 1)) == "other"
    assert labels.label_for("two\nlines") == "other"


def test_durations_fall_into_classes() -> None:
    histogram = Histogram(DURATION_BOUNDS)
    for seconds in (5.0, 5.1, 1e9):
        histogram.observe(seconds)
    assert histogram.counts == [1, 1, *[0] * (len(DURATION_BOUNDS) - 2), 1]
    assert histogram.total == 1e9 + 10.1


def test_an_end_is_counted_with_its_duration() -> None:
    statistics = Statistics()
    statistics.count_ended_order(
        order_status(state=TransportOrderState.FINISHED, finished=START + timedelta(seconds=42))
    )
    assert statistics.orders_ended == {"FINISHED": 1}
    assert statistics.order_durations["FINISHED"].total == 42


def test_orders_that_were_withdrawn_or_gave_way_are_no_failures() -> None:
    statistics = Statistics()
    for outcome in (OrderOutcome.GAVE_WAY, OrderOutcome.WITHDRAWN, OrderOutcome.FAILED, None):
        statistics.count_ended_order(order_status(state=TransportOrderState.FAILED, outcome=outcome))
    assert statistics.orders_ended == {"WITHDRAWN": 1, "FAILED": 2}
