"""Errors with which hosts' requests are refused; each is a refusal in the table of operations."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import ClassVar

from nena_shared.fleet_api.refusals import Refusal


class RefusedError(Exception):
    """A request is refused; the message says why and what to do."""

    refusal: ClassVar[Refusal]


class NameTakenError(RefusedError):
    """Another request has already created an order or order sequence of this name."""

    refusal = Refusal.NAME_TAKEN

    def __init__(self, name: str, kind: str = "Transport order") -> None:
        super().__init__(
            f"{kind} {name!r} already exists, and names are never reused. "
            "Choose another name, or set incompleteName to have a suffix added."
        )


class KeyReusedError(RefusedError):
    """The idempotency key was used for a different request."""

    refusal = Refusal.KEY_REUSED

    def __init__(self, key: str, name: str) -> None:
        super().__init__(
            f"idempotencyKey {key!r} was already used for {name!r} with a different body. "
            "Nothing was created. Use a new key for a new request."
        )


class UnknownOrderError(RefusedError):
    """There is no order of this name."""

    refusal = Refusal.UNKNOWN_ORDER

    def __init__(self, name: str) -> None:
        super().__init__(f"Unknown transport order {name!r}. GET /v1/transportOrders lists them.")


class UnknownVehicleError(RefusedError):
    """There is no vehicle of this name."""

    refusal = Refusal.UNKNOWN_VEHICLE

    def __init__(self, name: str) -> None:
        super().__init__(f"Unknown vehicle {name!r}. GET /v1/vehicles lists them.")


class UnknownSequenceError(RefusedError):
    """There is no order sequence of this name."""

    refusal = Refusal.UNKNOWN_SEQUENCE

    def __init__(self, name: str) -> None:
        super().__init__(f"Unknown order sequence {name!r}. GET /v1/orderSequences lists them.")


class SequenceRefusesError(RefusedError):
    """The order sequence refuses this order."""

    refusal = Refusal.SEQUENCE_REFUSES

    def __init__(self, name: str, reasons: Iterable[str]) -> None:
        super().__init__(f"Order sequence {name!r} refuses this order: {'; '.join(reasons)}.")


class UnknownDependencyError(RefusedError):
    """An order depends on one that does not exist."""

    refusal = Refusal.UNKNOWN_DEPENDENCY

    def __init__(self, names: Iterable[str]) -> None:
        super().__init__(
            f"There is no transport order {' or '.join(map(repr, names))} to depend on. "
            "Create the dependencies first."
        )


class OrderEndedError(RefusedError):
    """The order is in a final state and cannot be changed."""

    refusal = Refusal.ORDER_ENDED

    def __init__(self, name: str, state: str) -> None:
        super().__init__(f"Transport order {name!r} is already {state} and cannot be changed.")


class OrderAssignedError(RefusedError):
    """A vehicle has the order, or its sequence chooses the vehicle."""

    refusal = Refusal.ORDER_ASSIGNED

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(
            f"Transport order {name!r} cannot be changed: {reason}. Withdraw it and create another one."
        )


class UnknownPeripheralError(RefusedError):
    """No peripheral device is at this location."""

    refusal = Refusal.UNKNOWN_PERIPHERAL

    def __init__(self, location: str) -> None:
        super().__init__(f"Location {location!r} has no peripheral device. GET /v1/peripherals lists them.")


class UnknownPeripheralJobError(RefusedError):
    """There is no peripheral job of this name."""

    refusal = Refusal.UNKNOWN_JOB

    def __init__(self, name: str) -> None:
        super().__init__(f"Unknown peripheral job {name!r}. GET /v1/peripheralJobs lists them.")


class PeripheralJobEndedError(RefusedError):
    """The peripheral job has ended."""

    refusal = Refusal.JOB_ENDED

    def __init__(self, name: str, state: str) -> None:
        super().__init__(f"Peripheral job {name!r} is already {state} and cannot be withdrawn.")


class OrderWithdrawnError(RefusedError):
    """The order is already withdrawn."""

    refusal = Refusal.ORDER_WITHDRAWN

    def __init__(self, name: str) -> None:
        super().__init__(
            f"Transport order {name!r} is already withdrawn and ends as soon as its vehicle stops."
        )


class VehicleNotReachedError(RefusedError):
    """The robot cannot be reached."""

    refusal = Refusal.NOT_REACHED

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(f"Vehicle {name!r} cannot be reached: {reason}. Retry when it is online.")


class VehicleBusyError(RefusedError):
    """The vehicle has an order, or makes room for another vehicle, which the request would interrupt."""

    refusal = Refusal.VEHICLE_BUSY

    def __init__(self, name: str, order: str) -> None:
        if order:
            text = f"works on order {order!r}. Wait for its end, or withdraw it."
        else:
            text = "makes room for another vehicle. Retry when it has arrived."
        super().__init__(f"Vehicle {name!r} {text}")


class NotReroutableError(RefusedError):
    """The vehicle has no order that can be rerouted."""

    refusal = Refusal.NOT_REROUTABLE

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(f"Vehicle {name!r} cannot be rerouted: {reason}.")


class InvalidPlantError(RefusedError):
    """The plant model is invalid."""

    refusal = Refusal.INVALID_PLANT

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__(
            "The plant model is invalid; nothing was changed. Fix the problems listed in errors."
        )
        self.problems = tuple(problems)


class PlantInUseError(RefusedError):
    """Orders or vehicles use parts that a new plant model lacks."""

    refusal = Refusal.PLANT_IN_USE

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__(
            "Orders or vehicles use parts that the new plant model lacks; nothing was changed. Wait for the "
            "orders to end, withdraw them, or keep the parts listed in errors."
        )
        self.problems = tuple(problems)


class UnknownPlantDraftError(RefusedError):
    """There is no such draft or version of the plant model."""

    refusal = Refusal.UNKNOWN_PLANT_DRAFT

    def __init__(self, name: str | int) -> None:
        drafts = f"Unknown draft {name!r}. GET /v1/plantDrafts lists them."
        versions = (
            f"Unknown version {name} of the plant model. GET /v1/plantVersions lists those that are kept."
        )
        super().__init__(drafts if isinstance(name, str) else versions)


class PlantDraftChangedError(RefusedError):
    """Somebody has saved the draft since the host read it."""

    refusal = Refusal.PLANT_DRAFT_CHANGED

    def __init__(self, name: str, version: int, by: str, at: str) -> None:
        super().__init__(
            f"{by} saved version {version} of the draft {name!r} at {at}; nothing was changed. "
            "Open that version, or save yours under another name."
        )


class TooManyPlantDraftsError(RefusedError):
    """No more drafts can be stored."""

    refusal = Refusal.TOO_MANY_PLANT_DRAFTS

    def __init__(self, limit: int) -> None:
        super().__init__(f"There are {limit} drafts already. Delete one of them first.")


class PlantRunGoesOnError(RefusedError):
    """A program runs on a draft; the next one waits for its end."""

    refusal = Refusal.PLANT_RUN_GOES_ON

    def __init__(self, program: str, draft: str, by: str) -> None:
        super().__init__(f"{program} runs on the draft {draft!r}, started by {by}. Wait, or cancel it.")


class UnknownZoneSetError(RefusedError):
    """There is no zone set with this ID."""

    refusal = Refusal.UNKNOWN_ZONE_SET

    def __init__(self, name: str) -> None:
        super().__init__(f"Unknown zone set {name!r}. GET /v1/zoneSets lists them.")


class ZoneSetChangedError(RefusedError):
    """A different zone set already has this ID."""

    refusal = Refusal.ZONE_SET_CHANGED

    def __init__(self, name: str) -> None:
        super().__init__(
            f"A different zone set {name!r} already exists, and a stored zone set never changes. "
            "Choose a new zoneSetId."
        )


class StoreNotReadyError(RefusedError):
    """The store cannot be written; the request was not saved."""

    refusal = Refusal.NOT_SAVED

    def __init__(self, reason: str) -> None:
        super().__init__(
            f"Database unavailable ({reason}); the request was not saved. "
            "Retry with the same idempotencyKey; /readyz shows when the database is available again."
        )


class TooManyClientsError(RefusedError):
    """The event stream already has its maximum number of clients."""

    refusal = Refusal.TOO_MANY_CLIENTS

    def __init__(self, limit: int) -> None:
        super().__init__(
            f"The event stream already has {limit} clients. Try again later, or raise events.clients."
        )


class VersionChangedError(RefusedError):
    """The object has changed since the host read the version named in the request."""

    refusal = Refusal.VERSION_CHANGED

    def __init__(self, name: str, wanted: str, present: int) -> None:
        super().__init__(
            f"{name!r} has changed: it is at version {present}, the request expects {wanted}. "
            "Fetch the latest version and retry."
        )


class UnknownPointError(RefusedError):
    """The plant model has no point of this name."""

    refusal = Refusal.UNKNOWN_POINT

    def __init__(self, name: str) -> None:
        super().__init__(f"Unknown point {name!r}. GET /v1/points lists them.")


class UnknownLocationError(RefusedError):
    """The plant model has no location of this name."""

    refusal = Refusal.UNKNOWN_LOCATION

    def __init__(self, name: str) -> None:
        super().__init__(f"Unknown location {name!r}. GET /v1/locations lists them.")


class UnknownPathError(RefusedError):
    """There is no path of this name."""

    refusal = Refusal.UNKNOWN_PATH

    def __init__(self, name: str) -> None:
        super().__init__(f"Unknown path {name!r}. GET /v1/paths lists them.")


class UnknownStopError(RefusedError):
    """There is no active stop of this name."""

    refusal = Refusal.UNKNOWN_STOP

    def __init__(self, name: str) -> None:
        super().__init__(
            f"Unknown stop {name!r}; it may have been ended. GET /v1/stops lists the active ones."
        )


class TooManyStopsError(RefusedError):
    """No more stops can be active at once."""

    refusal = Refusal.TOO_MANY_STOPS

    def __init__(self, limit: int) -> None:
        super().__init__(f"{limit} stops are active. End one of them first.")


class VehicleStoppedError(RefusedError):
    """The vehicle cannot continue while a stop pauses it."""

    refusal = Refusal.VEHICLE_STOPPED

    def __init__(self, name: str, stop: str, why: str) -> None:
        super().__init__(f"Vehicle {name!r} cannot continue: {why}. End the stop {stop!r} first.")


class UnknownScheduleError(RefusedError):
    """There is no schedule of this name."""

    refusal = Refusal.UNKNOWN_SCHEDULE

    def __init__(self, name: str) -> None:
        super().__init__(f"Unknown schedule {name!r}. GET /v1/schedules lists them.")


class InvalidScheduleError(RefusedError):
    """A schedule can never run, or its name, cron expression or time zone is invalid."""

    refusal = Refusal.INVALID_SCHEDULE

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__("The schedule is invalid; nothing was saved. Fix what errors lists.")
        self.problems = tuple(problems)


class TooManySchedulesError(RefusedError):
    """No more schedules can be stored."""

    refusal = Refusal.TOO_MANY_SCHEDULES

    def __init__(self, limit: int) -> None:
        super().__init__(f"There are {limit} schedules already. Delete one of them first.")


class NoBlackBoxError(RefusedError):
    """The black box is disabled, so nothing has been recorded."""

    refusal = Refusal.NO_BLACK_BOX

    def __init__(self) -> None:
        super().__init__("Recording is off. Set black_box.enabled and restart the order service.")


class RecordingNotWrittenError(RefusedError):
    """The disk did not take a recording."""

    refusal = Refusal.RECORDING_NOT_WRITTEN

    def __init__(self, error: OSError) -> None:
        super().__init__(f"The recording was not written: {error}. Check the disk and upload.folder.")
