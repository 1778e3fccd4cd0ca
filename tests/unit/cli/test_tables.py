from __future__ import annotations

from io import StringIO

from rich.console import Console, RenderableType

from nena_cli import tables
from nena_cli.tables import history_table, sequence_details, sequences_table
from nena_cli.watching import ENDED_SHOWN, Board
from nena_client import Event
from nena_order_service.orders.order_sequence import OrderSequence
from nena_shared.fleet_api.reasons import Reason
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.fleet_api.transport_order import (
    DeliveryPhase,
    DeliveryStatus,
    OrderSequenceRequest,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import (
    PrecisePosition,
    ProcessingState,
    RobotMap,
    VehicleState,
    VehicleStatus,
)
from support.order_service import NOW, assigned_order, dispatchable_order


def text_of(what: RenderableType) -> str:
    out = StringIO()
    Console(file=out, width=300).print(what)
    return out.getvalue()


def test_orders_say_where_they_are_and_no_markup_is_read() -> None:
    order = assigned_order("A", "B:Load [bold]", name="T-[red]1", vehicle="V-[blink]1", priority=3)
    shown = text_of(tables.orders_table([order.status]))
    for part in ("T-[red]1", "BEING_PROCESSED", "V-[blink]1", "A: MOVE > B: Load [bold]", "3"):
        assert part in shown


def test_details_include_the_delivery_and_omit_empty_values() -> None:
    delivery = DeliveryStatus(
        transport_order="T-1", phase=DeliveryPhase.SENT, order_id="T-1-0", note="no state echoes it yet"
    )
    shown = text_of(tables.order_details(assigned_order("A").status, delivery))
    assert "SENT T-1-0 no state echoes it yet" in shown
    assert "deadline" not in shown
    assert "assignedToVehicle" in text_of(tables.history_table(assigned_order("A").status))


VEHICLE = VehicleStatus(
    name="V-1",
    manufacturer="NeNa",
    serial_number="v1",
    state=VehicleState.ERROR,
    processing_state=ProcessingState.IDLE,
    reason="has an error",
    connection="ONLINE",
    precise_position=PrecisePosition(x=1.25, y=2.0, theta=0.0, map_id="m"),
    energy_level=41.6,
    errors=("FATAL lost",),
)


def test_vehicles_say_where_they_stand_and_why() -> None:
    shown = text_of(tables.vehicles_table([VEHICLE]))
    for part in ("V-1", "ERROR", "1.25, 2.00", "42 %", "has an error; FATAL lost"):
        assert part in shown
    assert "maps" not in shown
    assert "deviates" not in shown
    sloppy = VEHICLE.model_copy(update={"deviations": ('state.headerId "1": text as number',)})
    shown = text_of(tables.vehicles_table([sloppy]))
    assert 'this robot deviates from VDA 5050: state.headerId "1": text as number' in shown
    maps = tuple(RobotMap(map_id="hall", map_version=each, enabled=each == "2") for each in ("1", "2"))
    shown = text_of(tables.vehicles_table([VEHICLE, VEHICLE.model_copy(update={"maps": maps})]))
    assert "hall 1, hall 2" in shown


def waiting(name: str, *others: str) -> VehicleStatus:
    wait = TrafficWait(vehicles=others, at="B", cause=WaitCause.PASSES, reason="it waits")
    return VEHICLE.model_copy(update={"name": name, "state": VehicleState.IDLE, "wait": wait})


def test_vehicles_that_wait_in_a_circle_are_named() -> None:
    shown = text_of(
        tables.vehicles_table([waiting("V-3", "V-2"), waiting("V-2", "V-3"), waiting("V-4", "V-3")])
    )
    assert "V-3 > V-2 (circle: V-2, V-3)" in shown


def test_board_shows_the_newest_of_each_and_lets_old_ends_go() -> None:
    board = Board(TransportOrderStatus, tables.orders_table)
    for number in range(ENDED_SHOWN + 5):
        order = dispatchable_order(number=number).failed(Reason.of("withdrawn"), NOW)
        board.take(Event("transportOrder", None, order.status.model_dump(mode="json", by_alias=True)))
    waiting = dispatchable_order(number=99).status.model_dump(mode="json", by_alias=True)
    for _ in range(2):
        board.take(Event("transportOrder", None, waiting))
    shown = text_of(board)
    assert shown.count("T-99") == 1
    assert shown.count("FAILED") == ENDED_SHOWN
    assert "T-4 " not in shown
    assert "T-5 " in shown


def test_sequences_say_how_far_they_are_and_no_markup_is_read() -> None:
    asked = OrderSequenceRequest(intended_vehicle="V-[red]1", failure_fatal=True)
    made = OrderSequence.created(asked, number=1, name="S", now=NOW).appended("T-1", NOW).appended("T-2", NOW)
    shown = text_of(sequences_table([made.status]))
    for part in ("(V-[red]1)", "open", "T-1 > T-2", "to start 'T-1'"):
        assert part in shown
    shown = text_of(sequence_details(made.bound("V-[red]1", NOW).completed("enough", NOW).status))
    for part in ("complete", "ends the sequence", "vehicle V-[red]1 will execute 'T-1', 1 of 2"):
        assert part in shown
    assert "orderAppended" in text_of(history_table(made.status))
    ended = made.completed("enough", NOW).advanced(lambda _: True, NOW)
    assert "finished" in text_of(sequences_table([ended.status]))
