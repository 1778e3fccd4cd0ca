"""What a device's answers mean, and when a job is sent again or fails."""

from __future__ import annotations

from nena_order_service.peripherals.devices import EXECUTION_TIMEOUT, Devices, Overdue, Verdict
from nena_order_service.peripherals.settings import PeripheralSettings
from nena_shared.fleet_api.peripherals import DeviceJobState, PeripheralState
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.plant import Location

D = DeviceJobState


def devices() -> Devices:
    made = Devices(PeripheralSettings(acknowledge_timeout=5, sends=2, execution_timeout=60))
    made.begin("Door", "J", 0.0)
    return made


def test_a_device_executes_one_job_at_a_time() -> None:
    made = devices()
    assert (made.job("Door"), made.is_free("Door"), made.is_free("Lift")) == ("J", False, True)
    assert made.state("Door") is PeripheralState.EXECUTING
    made.end("Door", "other")
    assert made.job("Door") == "J"
    made.end("Door", "J")
    assert made.is_free("Door")
    assert made.state("Door") is PeripheralState.UNKNOWN


def test_repeated_and_foreign_answers_are_ignored() -> None:
    made = devices()
    assert made.answer("Door", "other", D.FINISHED, 1.0) is Verdict.IGNORED
    assert made.answer("Lift", "J", D.FINISHED, 1.0) is Verdict.IGNORED
    assert made.answer("Door", "J", D.ACKNOWLEDGED, 1.0) is Verdict.ACCEPTED
    assert made.answer("Door", "J", D.ACKNOWLEDGED, 2.0) is Verdict.IGNORED
    assert made.answer("Door", "J", D.FINISHED, 3.0) is Verdict.FINISHED


def test_an_end_without_acknowledgement_counts() -> None:
    assert devices().answer("Door", "J", D.FAILED, 1.0) is Verdict.FAILED


def test_the_time_of_an_execution_begins_with_its_acknowledgement() -> None:
    made = devices()
    made.answer("Door", "J", D.ACKNOWLEDGED, 4.0)
    assert made.overdue(63.9) == []
    assert made.overdue(64.0) == [
        Overdue("J", "Door", Reason(ReasonCode.DEVICE_SLOW, location="Door", limit=60.0))
    ]


def test_a_location_may_have_a_timeout_of_its_own() -> None:
    made = devices()
    for given in ("90", "soon", "-1", "inf", "nan"):
        made.expect(
            Location(name="Door", x_mm=0, y_mm=0, type="Doors", properties={EXECUTION_TIMEOUT: given})
        )
    made.answer("Door", "J", D.ACKNOWLEDGED, 0.0)
    assert made.overdue(89.9) == []
    assert made.overdue(90.0) != []


def test_times_begin_again_when_devices_can_be_reached_again() -> None:
    made = devices()
    made.overdue(5.0)
    made.restart_times(100.0)
    assert made.overdue(104.9) == []
    assert made.overdue(105.0) == [Overdue("J", "Door")]
