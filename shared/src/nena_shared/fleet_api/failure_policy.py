"""What is done about a transport order whose vehicle fails at it, and who holds an order."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from nena_shared.fleet_api.base import Moment, Request, Resource


class FailureMeasure(StrEnum):
    """One thing that can be done about a failure."""

    RETRY = "RETRY"
    """The same vehicle does the same destination again, from where it stands."""
    REPLAN = "REPLAN"
    """The same vehicle takes another way, which avoids where it failed."""
    OTHER_VEHICLE = "OTHER_VEHICLE"
    """The order waits for another vehicle; never while the vehicle carries something for it."""
    SKIP = "SKIP"
    """The operation is left out, and the order goes on with the next destination."""
    HOLD = "HOLD"
    """The order keeps its vehicle and waits until a person resumes or withdraws it."""
    FAIL = "FAIL"

    @property
    def last(self) -> bool:
        """Whether nothing can come after it."""
        return self in (FailureMeasure.HOLD, FailureMeasure.FAIL)


ONCE = (FailureMeasure.SKIP, FailureMeasure.HOLD, FailureMeasure.FAIL)


class FailureStep(Request):
    """A measure, how often it is taken, and how many seconds after the failure."""

    do: FailureMeasure
    times: Annotated[int, Field(ge=1, le=100)] = 1
    after: Annotated[float, Field(ge=0, le=86_400)] = 0.0
    """Only of RETRY and REPLAN."""

    @model_validator(mode="after")
    def _makes_sense(self) -> Self:
        if self.times > 1 and self.do in ONCE:
            message = f"{self.do} is done once: leave times out"
            raise ValueError(message)
        if self.after and self.do not in (FailureMeasure.RETRY, FailureMeasure.REPLAN):
            message = f"{self.do} waits for nothing: leave after out"
            raise ValueError(message)
        return self


def _ends_once(steps: tuple[FailureStep, ...]) -> tuple[FailureStep, ...]:
    if any(step.do.last for step in steps[:-1]):
        message = "nothing comes after HOLD or FAIL: put it last"
        raise ValueError(message)
    return steps


FailurePolicy = Annotated[tuple[FailureStep, ...], Field(max_length=20), AfterValidator(_ends_once)]
"""Steps that are tried in turn; one that makes no sense for a failure is passed over, and FAIL comes last."""

Seconds = Annotated[float, Field(gt=0, le=31_536_000)]


class Hold(Resource):
    """An order that goes on when a person says so."""

    by: str
    """Who holds it: a host or a person by name; ``failure policy`` for the order service itself."""
    reason: str
    since: Moment
