"""Order sequences are written, replaced and read again, in both stores."""

from __future__ import annotations

from nena_order_service.orders.order_sequence import OrderSequence
from nena_order_service.store.changes import Changes
from nena_order_service.store.database import open_database, read_unfinished, write
from nena_order_service.store.sequences import SequenceFilter, read_sequence, read_sequences
from nena_shared.fleet_api.transport_order import OrderSequenceRequest
from support.order_service import NOW


def sequence(number: int, **fields: object) -> OrderSequence:
    asked = OrderSequenceRequest.model_validate(fields)
    return OrderSequence.created(asked, number=number, name=f"S-{number}", now=NOW)


def test_the_newest_version_of_each_sequence_counts(url: str) -> None:
    engine = open_database(url)
    first, second = sequence(1, idempotencyKey="k"), sequence(2, intendedVehicle="V-1", failureFatal=True)
    made, later = Changes(), Changes()
    made.put_sequence(first)
    made.put_sequence(second)
    grown = second.appended("T-1", NOW).bound("V-1", NOW)
    later.put_sequence(grown)
    assert made
    made.merge(later)
    write(engine, made)
    found = read_unfinished(engine)
    assert (found.sequences, found.last_sequence) == ((first, grown), 2)

    ended, done = Changes(), first.completed("by a host", NOW)
    ended.put_sequence(done)
    write(engine, ended)
    found = read_unfinished(engine)
    assert (found.sequences, found.last_sequence) == ((grown,), 2)
    assert read_sequence(engine, name="S-1") == done
    assert read_sequence(engine, name="other", idempotency_key="k") == done
    assert read_sequence(engine, name="other") is None
    assert read_sequence(engine, name="S-1\0", idempotency_key="k\0") is None
    assert read_sequences(engine, SequenceFilter(intended_vehicle="V-1\0")) == ()


def test_sequences_are_listed_newest_first_as_they_are_asked_for(url: str) -> None:
    engine = open_database(url)
    changes = Changes()
    for number in range(1, 5):
        one = sequence(number, intendedVehicle="V-1" if number > 2 else None)
        changes.put_sequence(one.completed("by a host", NOW) if number == 4 else one)
    write(engine, changes)

    def numbers(wanted: SequenceFilter) -> list[int]:
        return [each.number for each in read_sequences(engine, wanted)]

    assert numbers(SequenceFilter()) == [4, 3, 2, 1]
    assert numbers(SequenceFilter(finished=True)) == [4]
    assert numbers(SequenceFilter(finished=False, limit=2)) == [3, 2]
    assert numbers(SequenceFilter(intended_vehicle="V-1")) == [4, 3]
    assert numbers(SequenceFilter(before=3)) == [2, 1]
