from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from nena_order_service.fleet.outputs import Delivery
from nena_order_service.fleet.settings import FleetSettings

SETTINGS = st.builds(
    FleetSettings,
    sendings=st.integers(1, 6),
    resend_after=st.floats(0.5, 5.0),
    resend_at_most_after=st.floats(5.0, 20.0),
)


def sendings(delivery: Delivery, begin: float = 100.0) -> list[float]:
    """Send whenever it is due, checked each tenth of a second, until it has failed."""
    times, now = [], begin
    while not delivery.has_failed(now):
        if delivery.is_due(now):
            delivery.note_sent(now)
            times.append(now)
        now = round(now + 0.1, 1)
    return times


@given(SETTINGS)
def test_sending_is_repeated_with_growing_bounded_delays(settings: FleetSettings) -> None:
    times = sendings(Delivery(settings))

    assert len(times) == settings.sendings
    pauses = [later - earlier for earlier, later in pairwise(times)]
    assert all(pause <= settings.resend_at_most_after + 0.2 for pause in pauses)
    assert all(later >= earlier - 0.2 for earlier, later in pairwise(pauses))


@given(SETTINGS)
def test_after_an_outage_delivery_restarts_at_once(settings: FleetSettings) -> None:
    delivery = Delivery(settings)
    sendings(delivery)

    delivery.restart()

    assert delivery.is_due(0.0)
    assert delivery.in_all == settings.sendings
    assert len(sendings(delivery)) == settings.sendings


def test_a_refusal_counts_if_it_names_the_message_or_no_attempts_are_left() -> None:
    delivery = Delivery(FleetSettings(sendings=1, resend_after=5.0))
    assert delivery.is_refused(100.0, named=True)
    delivery.note_sent(100.0)
    assert delivery.is_refused(101.0, named=False)


def test_a_refusal_from_before_an_outage_does_not_count() -> None:
    delivery = Delivery(FleetSettings(sendings=3, resend_after=5.0))
    delivery.note_sent(100.0)
    delivery.is_refused(101.0, named=False)

    delivery.restart()

    assert not delivery.is_refused(200.0, named=False)
