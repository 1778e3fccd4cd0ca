"""Errors that are answers to hosts; :mod:`nena_order_service.api.problems` maps each to one problem."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


class NameTakenError(Exception):
    """Another request has already created an order of this name."""

    def __init__(self, name: str) -> None:
        super().__init__(
            f"Transport order {name!r} already exists, and a name is used only once. "
            "Choose another name, or set incompleteName to have a suffix added."
        )
        self.name = name


class KeyReusedError(Exception):
    """The idempotency key was used for a different request."""

    def __init__(self, key: str, name: str) -> None:
        super().__init__(
            f"idempotencyKey {key!r} was already used for {name!r} with a different body. "
            "Nothing was created. Use a new key for a new request."
        )
        self.key = key
        self.name = name


class UnknownOrderError(Exception):
    """There is no order of this name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"There is no transport order {name!r}. GET /v1/transportOrders lists them.")
        self.name = name


class UnknownVehicleError(Exception):
    """There is no vehicle of this name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"There is no vehicle {name!r}. GET /v1/vehicles lists them.")
        self.name = name


class SequenceNameTakenError(Exception):
    """Another request has already created an order sequence of this name."""

    def __init__(self, name: str) -> None:
        super().__init__(
            f"Order sequence {name!r} already exists, and a name is used only once. "
            "Choose another name, or set incompleteName to have a suffix added."
        )
        self.name = name


class UnknownSequenceError(Exception):
    """There is no order sequence of this name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"There is no order sequence {name!r}. GET /v1/orderSequences lists them.")
        self.name = name


class SequenceRefusesError(Exception):
    """The order sequence refuses this order."""

    def __init__(self, name: str, reasons: Iterable[str]) -> None:
        self.reasons = tuple(reasons)
        super().__init__(f"Order sequence {name!r} refuses this order: {'; '.join(self.reasons)}.")
        self.name = name


class UnknownDependencyError(Exception):
    """An order depends on one that does not exist."""

    def __init__(self, names: Iterable[str]) -> None:
        self.names = tuple(names)
        super().__init__(
            f"There is no transport order {' or '.join(map(repr, self.names))} to depend on. "
            "Create the dependencies first."
        )


class OrderEndedError(Exception):
    """The order is in a final state and cannot be changed."""

    def __init__(self, name: str, state: str) -> None:
        super().__init__(f"Transport order {name!r} is {state} already and cannot be changed.")
        self.name = name
        self.state = state


class OrderWithdrawnError(Exception):
    """The order is about to end and cannot be held."""

    def __init__(self, name: str) -> None:
        super().__init__(
            f"Transport order {name!r} is already withdrawn. It ends when its vehicle has released it."
        )
        self.name = name


class VehicleNotReachedError(Exception):
    """The robot cannot be reached."""

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(f"Vehicle {name!r} cannot be reached: {reason}. Try again when it is online.")
        self.name = name


class NotReroutableError(Exception):
    """The vehicle has no order whose route could change."""

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(f"Vehicle {name!r} cannot be rerouted: {reason}.")
        self.name = name
        self.reason = reason


class InvalidPlantError(Exception):
    """The plant model cannot be used."""

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__(
            "The plant model cannot be used; nothing was changed. Fix the problems listed in errors."
        )
        self.problems = tuple(problems)


class PlantInUseError(Exception):
    """Orders or vehicles use parts that a new plant model lacks."""

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__(
            "Orders or vehicles use parts that the new plant model lacks; nothing was changed. Wait for the "
            "orders to end, withdraw them, or keep the parts listed in errors."
        )
        self.problems = tuple(problems)


class UnknownZoneSetError(Exception):
    """There is no zone set of this id."""

    def __init__(self, name: str) -> None:
        super().__init__(f"There is no zone set {name!r}. GET /v1/zoneSets lists them.")
        self.name = name


class ZoneSetChangedError(Exception):
    """Another zone set has this id."""

    def __init__(self, name: str) -> None:
        super().__init__(
            f"A different zone set {name!r} already exists, and a stored zone set never changes. "
            "Choose a new zoneSetId."
        )
        self.name = name


class StoreNotReadyError(Exception):
    """The store cannot be written; the request was not saved."""

    def __init__(self, reason: str) -> None:
        super().__init__(
            f"Database unavailable ({reason}); the request was not saved. "
            "Retry with the same idempotencyKey; /readyz shows when the database is available again."
        )


class TooManyClientsError(Exception):
    """The event stream has the most clients that it may have."""

    def __init__(self, limit: int) -> None:
        super().__init__(
            f"The event stream already has {limit} clients. Try again later, or raise events.clients."
        )


class VersionChangedError(Exception):
    """The object has changed since the request has seen it."""

    def __init__(self, name: str, wanted: str, present: int) -> None:
        super().__init__(
            f"{name!r} has changed: it is at version {present}, the request expects {wanted}. "
            "Fetch the latest version and retry."
        )
        self.name = name
        self.present = present


class UnknownPathError(Exception):
    """There is no path of this name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"There is no path {name!r}. GET /v1/paths lists them.")
        self.name = name
