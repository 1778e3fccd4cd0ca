"""Maps each error of the order service to one problem (RFC 9457), the same over REST and over MQTT."""

from __future__ import annotations

from http import HTTPStatus

from nena_order_service import errors
from nena_order_service.orders.validation import InvalidRequestError
from nena_shared.fleet_api.transport_order import Problem

STATUS: dict[type[Exception], HTTPStatus] = {
    errors.NameTakenError: HTTPStatus.CONFLICT,
    errors.KeyReusedError: HTTPStatus.UNPROCESSABLE_ENTITY,
    errors.SequenceNameTakenError: HTTPStatus.CONFLICT,
    errors.SequenceRefusesError: HTTPStatus.CONFLICT,
    errors.UnknownSequenceError: HTTPStatus.NOT_FOUND,
    errors.UnknownDependencyError: HTTPStatus.NOT_FOUND,
    errors.OrderEndedError: HTTPStatus.CONFLICT,
    errors.OrderWithdrawnError: HTTPStatus.CONFLICT,
    errors.VehicleNotReachedError: HTTPStatus.CONFLICT,
    errors.NotReroutableError: HTTPStatus.CONFLICT,
    errors.PlantInUseError: HTTPStatus.CONFLICT,
    errors.ZoneSetChangedError: HTTPStatus.CONFLICT,
    errors.UnknownZoneSetError: HTTPStatus.NOT_FOUND,
    errors.InvalidPlantError: HTTPStatus.UNPROCESSABLE_ENTITY,
    errors.UnknownOrderError: HTTPStatus.NOT_FOUND,
    errors.UnknownVehicleError: HTTPStatus.NOT_FOUND,
    errors.StoreNotReadyError: HTTPStatus.SERVICE_UNAVAILABLE,
    errors.TooManyClientsError: HTTPStatus.SERVICE_UNAVAILABLE,
    errors.UnknownPathError: HTTPStatus.NOT_FOUND,
    errors.VersionChangedError: HTTPStatus.PRECONDITION_FAILED,
}

FORESEEN: tuple[type[Exception], ...] = (InvalidRequestError, *STATUS)
"""Errors that are answers, not faults."""


def problem_of(error: Exception) -> Problem:
    """Say what went wrong; an error that nobody foresaw gives no inside view."""
    if isinstance(error, InvalidRequestError):
        return _invalid(error)
    status = STATUS.get(type(error))
    if status is None:
        return Problem(
            title="Internal error",
            status=HTTPStatus.INTERNAL_SERVER_ERROR,
            detail="The order service failed at this request; its log says why. Please report it.",
        )
    problems: tuple[str, ...] = getattr(error, "problems", ())
    return Problem(title=status.phrase, status=status, detail=str(error), errors=problems)


def _invalid(error: InvalidRequestError) -> Problem:
    status = HTTPStatus.NOT_FOUND if error.only_unknown else HTTPStatus.UNPROCESSABLE_ENTITY
    return Problem(
        title="Not possible in this plant",
        status=status,
        detail="The plant does not allow this request. Correct what errors names; nothing was created.",
        errors=tuple(finding.text for finding in error.findings),
    )
