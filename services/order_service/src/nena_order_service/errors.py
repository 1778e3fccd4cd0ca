"""What the order service refuses to its hosts; each error is one answer, see :mod:`problems`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


class NameTakenError(Exception):
    """An order of this name exists already, made by another request."""

    def __init__(self, name: str) -> None:
        super().__init__(
            f"A transport order {name!r} exists already, and names are never used twice. "
            "Choose another name, or set incompleteName to have it completed."
        )
        self.name = name


class KeyReusedError(Exception):
    """The idempotency key has made something else than what is asked for now."""

    def __init__(self, key: str, name: str) -> None:
        super().__init__(
            f"The idempotencyKey {key!r} has made {name!r} by a request that said "
            "something else. Nothing was created; take a new key for something new."
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
    """An order sequence of this name exists already, made by another request."""

    def __init__(self, name: str) -> None:
        super().__init__(
            f"An order sequence {name!r} exists already, and names are never used twice. "
            "Choose another name, or set incompleteName to have it completed."
        )
        self.name = name


class UnknownSequenceError(Exception):
    """There is no order sequence of this name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"There is no order sequence {name!r}. GET /v1/orderSequences lists them.")
        self.name = name


class SequenceRefusesError(Exception):
    """The order sequence does not take this order."""

    def __init__(self, name: str, reasons: Iterable[str]) -> None:
        self.reasons = tuple(reasons)
        super().__init__(f"Order sequence {name!r} does not take this order: {'; '.join(self.reasons)}.")
        self.name = name


class UnknownDependencyError(Exception):
    """An order would wait for one that there is not."""

    def __init__(self, names: Iterable[str]) -> None:
        self.names = tuple(names)
        super().__init__(
            f"There is no transport order {' or '.join(map(repr, self.names))}, so nothing can depend on it. "
            "Create those first on which others depend."
        )


class OrderEndedError(Exception):
    """The order is in a final state; nothing can be changed about it."""

    def __init__(self, name: str, state: str) -> None:
        super().__init__(f"Transport order {name!r} is {state} already; nothing about it can be changed.")
        self.name = name
        self.state = state


class OrderWithdrawnError(Exception):
    """The order is about to end; it cannot be held."""

    def __init__(self, name: str) -> None:
        super().__init__(
            f"Transport order {name!r} is withdrawn already, and ends when its vehicle lets it go."
        )
        self.name = name


class VehicleNotReachedError(Exception):
    """The robot is not there to be told something."""

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(
            f"Vehicle {name!r} cannot be told anything now: {reason}. Try again when it is back."
        )
        self.name = name


class NotReroutableError(Exception):
    """The vehicle has nothing whose way could change."""

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(f"Vehicle {name!r} cannot be rerouted: {reason}.")
        self.name = name
        self.reason = reason


class InvalidPlantError(Exception):
    """What was sent is no plant model that can be used."""

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__(
            "This is no plant model that can be used. Correct what errors names; nothing was changed."
        )
        self.problems = tuple(problems)


class PlantInUseError(Exception):
    """Orders or vehicles use what a new plant model does not have."""

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__(
            "Orders or vehicles use what the new plant model does not have. Wait for their end, withdraw the "
            "orders, or keep what errors names; nothing was changed."
        )
        self.problems = tuple(problems)


class UnknownZoneSetError(Exception):
    """There is no zone set of this id."""

    def __init__(self, name: str) -> None:
        super().__init__(f"There is no zone set {name!r}. GET /v1/zoneSets lists them.")
        self.name = name


class ZoneSetChangedError(Exception):
    """Another zone set was put here under this id."""

    def __init__(self, name: str) -> None:
        super().__init__(
            f"Another zone set {name!r} was put here before, and what stands under an id never changes. "
            "Choose a new zoneSetId."
        )
        self.name = name


class StoreNotReadyError(Exception):
    """Nothing can be kept, so nothing is promised."""

    def __init__(self, reason: str) -> None:
        super().__init__(
            f"The store takes nothing at present ({reason}), so nothing is promised. "
            "Try again with the same idempotencyKey; /readyz tells when the store is back."
        )


class TooManyClientsError(Exception):
    """There is no room for another client of the event stream."""

    def __init__(self, limit: int) -> None:
        super().__init__(
            f"{limit} clients follow the events already. Try again later, or raise events.clients."
        )


class VersionChangedError(Exception):
    """What is to be changed is not any more as the request has seen it."""

    def __init__(self, name: str, wanted: str, present: int) -> None:
        super().__init__(
            f"{name!r} has changed: it is version {present} now, and {wanted} is asked for. "
            "Read it again, and ask again if it still shall be changed."
        )
        self.name = name
        self.present = present


class UnknownPathError(Exception):
    """There is no path of this name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"There is no path {name!r}. GET /v1/paths lists them.")
        self.name = name
