"""Errors with which hosts' requests are refused; each is a refusal in the table of operations."""

from __future__ import annotations

from collections.abc import Sequence

from nena_shared.fleet_api.refusals import Refusal


class RefusedError(Exception):
    """A request is refused; the message says why and what to do."""

    def __init__(self, refusal: Refusal, text: str, problems: Sequence[str] = ()) -> None:
        super().__init__(text)
        self.refusal = refusal
        self.problems = tuple(problems)


class UnknownError(RefusedError):
    """A request names something that does not exist."""

    def __init__(self, refusal: Refusal, name: str | int) -> None:
        remedy = refusal.remedy.replace("`", "")
        super().__init__(refusal, f"{refusal.meaning.removesuffix('.')} {name!r}. {remedy}")


class NameTakenError(RefusedError):
    """Another request has already created an order or order sequence of this name."""

    def __init__(self, name: str, kind: str = "Transport order") -> None:
        super().__init__(
            Refusal.NAME_TAKEN,
            f"{kind} {name!r} already exists, and names are never reused. "
            "Choose another name, or set incompleteName to have a suffix added.",
        )


class KeyReusedError(RefusedError):
    """The idempotency key was used for a different request."""

    def __init__(self, key: str, name: str) -> None:
        super().__init__(
            Refusal.KEY_REUSED,
            f"idempotencyKey {key!r} was already used for {name!r} with a different body. "
            "Nothing was created. Use a new key for a new request.",
        )


class OrderEndedError(RefusedError):
    """The order is in a final state and cannot be changed."""

    def __init__(self, name: str, state: str) -> None:
        super().__init__(
            Refusal.ORDER_ENDED, f"Transport order {name!r} is already {state} and cannot be changed."
        )


class OrderAssignedError(RefusedError):
    """A vehicle has the order, or its sequence chooses the vehicle."""

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(
            Refusal.ORDER_ASSIGNED,
            f"Transport order {name!r} cannot be changed: {reason}. Withdraw it and create another one.",
        )


class VehicleNotReachedError(RefusedError):
    """The robot cannot be reached."""

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(
            Refusal.NOT_REACHED, f"Vehicle {name!r} cannot be reached: {reason}. Retry when it is online."
        )


class NotReroutableError(RefusedError):
    """The vehicle has no order that can be rerouted."""

    def __init__(self, name: str, reason: str) -> None:
        super().__init__(Refusal.NOT_REROUTABLE, f"Vehicle {name!r} cannot be rerouted: {reason}.")


class InvalidPlantError(RefusedError):
    """The plant model is invalid."""

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__(
            Refusal.INVALID_PLANT,
            "The plant model is invalid; nothing was changed. Fix the problems listed in errors.",
            problems,
        )


class PlantInUseError(RefusedError):
    """Orders or vehicles use parts that a new plant model lacks."""

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__(
            Refusal.PLANT_IN_USE,
            "Orders or vehicles use parts that the new plant model lacks; nothing was changed. Wait for the "
            "orders to end, withdraw them, or keep the parts listed in errors.",
            problems,
        )


class StoreNotReadyError(RefusedError):
    """The store cannot be written; the request was not saved."""

    def __init__(self, reason: str) -> None:
        super().__init__(
            Refusal.NOT_SAVED,
            f"Database unavailable ({reason}); the request was not saved. "
            "Retry with the same idempotencyKey; /readyz shows when the database is available again.",
        )


class TooManyClientsError(RefusedError):
    """The event stream already has its maximum number of clients."""

    def __init__(self, limit: int) -> None:
        super().__init__(
            Refusal.TOO_MANY_CLIENTS,
            f"The event stream already has {limit} clients. Try again later, or raise events.clients.",
        )
