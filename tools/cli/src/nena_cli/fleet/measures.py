"""Measures of a failure policy as people write them."""

from __future__ import annotations

import typer
from pydantic import ValidationError

from nena_shared.fleet_api.failure_policy import FailureStep
from nena_shared.vda5050.malformed import problems_of

FIELDS = ("do", "times", "after")


def parse_measure(text: str) -> FailureStep:
    """Read ``MEASURE``, ``MEASURE:TIMES`` or ``MEASURE:TIMES:SECONDS``, such as ``RETRY:2:5``.

    Raises:
        typer.BadParameter: it is none of these.

    """
    parts = text.split(":")
    if len(parts) > len(FIELDS):
        message = f"{text!r} is no measure: give MEASURE:TIMES:SECONDS"
        raise typer.BadParameter(message)
    try:
        return FailureStep.model_validate(dict(zip(FIELDS, [parts[0].upper(), *parts[1:]], strict=False)))
    except ValidationError as error:
        message = f"{text!r} is no measure: {'; '.join(problems_of(error))}"
        raise typer.BadParameter(message) from error
