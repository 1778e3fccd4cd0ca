from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.fleet.delivery import Delivery
from nena_order_service.fleet.settings import FleetSettings

SETTINGS = st.builds(
    FleetSettings,
    sendings=st.integers(1, 6),
    resend_after=st.floats(0.5, 5.0),
    resend_at_most_after=st.floats(5.0, 20.0),
)


def sendings(delivery: Delivery, begin: float = 100.0) -> list[float]:
    """Send whenever it is due, looked at each tenth of a second, until it has failed."""
    times, now = [], begin
    while not delivery.failed(now):
        if delivery.due(now):
            delivery.sent(now)
            times.append(now)
        now = round(now + 0.1, 1)
    return times


@given(SETTINGS)
def test_it_is_sent_so_often_with_pauses_that_grow_up_to_a_bound(settings: FleetSettings) -> None:
    times = sendings(Delivery(settings))

    assert len(times) == settings.sendings
    pauses = [later - earlier for earlier, later in pairwise(times)]
    assert all(pause <= settings.resend_at_most_after + 0.2 for pause in pauses)
    assert all(later >= earlier - 0.2 for earlier, later in pairwise(pauses))


@given(SETTINGS)
def test_after_a_time_out_of_reach_all_begins_anew_and_at_once(settings: FleetSettings) -> None:
    delivery = Delivery(settings)
    sendings(delivery)

    delivery.hold()

    assert delivery.due(0.0)
    assert delivery.in_all == settings.sendings
    assert len(sendings(delivery)) == settings.sendings


def test_it_may_be_sent_again_before_its_time() -> None:
    delivery = Delivery(FleetSettings(sendings=2, resend_after=5.0))
    delivery.sent(100.0)
    assert not delivery.due(101.0)

    delivery.again()

    assert delivery.due(101.0)
    assert not delivery.failed(101.0)
