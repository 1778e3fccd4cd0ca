from __future__ import annotations

from io import StringIO

from rich.console import Console, RenderableType

from nena_cli.fleet.sequence_tables import sequence_details, sequence_history, sequences_table
from nena_order_service.orders.order_sequence import OrderSequence
from nena_shared.fleet_api.order_sequence import OrderSequenceRequest
from support.order_service import NOW


def text_of(what: RenderableType) -> str:
    out = StringIO()
    Console(file=out, width=300).print(what)
    return out.getvalue()


def test_sequences_say_how_far_they_are_and_no_markup_is_read() -> None:
    asked = OrderSequenceRequest(intended_vehicle="V-[red]1", failure_fatal=True)
    made = OrderSequence.created(asked, number=1, name="S", now=NOW).appended("T-1", NOW).appended("T-2", NOW)
    shown = text_of(sequences_table([made.status]))
    for part in ("(V-[red]1)", "open", "T-1 > T-2", "begins with 'T-1'"):
        assert part in shown
    shown = text_of(sequence_details(made.bound("V-[red]1", NOW).completed("enough", NOW).status))
    for part in ("complete", "ends it", "vehicle V-[red]1 is to do 'T-1', 1 of 2"):
        assert part in shown
    assert "orderAppended" in text_of(sequence_history(made.status))
    ended = made.completed("enough", NOW).advanced(lambda _: True, NOW)
    assert "finished" in text_of(sequences_table([ended.status]))
