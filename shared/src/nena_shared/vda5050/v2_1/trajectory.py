"""Trajectories of 2.1 (section 6.6.6), which has no defaults for degree and knots."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, model_validator

from nena_shared.vda5050.order import Trajectory

DEFAULT_DEGREE = 1


class TrajectoryV21(Trajectory):
    """A NURBS from the start to the end of an edge; what is left out is filled in with 3.0's defaults.

    Too few control points for the degree make no curve, so they get no knots.
    """

    degree: Annotated[
        Annotated[int, Field(ge=1)] | None, AfterValidator(lambda degree: degree or DEFAULT_DEGREE)
    ] = DEFAULT_DEGREE

    @staticmethod
    def finish_record(record: Any) -> Mapping[str, object]:  # noqa: ANN401 - it has the fields of the form
        """Leave to the codec what has to be filled in."""
        if record.degree is None or record.knot_vector is None:
            message = "degree and knots are filled in by the codec"
            raise ValueError(message)
        return {}

    @model_validator(mode="after")
    def _with_knots(self) -> Self:
        points, degree = len(self.control_points), self.degree or DEFAULT_DEGREE
        if self.knot_vector is not None or points <= degree:
            return self
        return self.model_copy(update={"knot_vector": uniform_knots(points, degree)})


def uniform_knots(control_points: int, degree: int) -> tuple[float, ...]:
    """Return clamped knots, evenly spread over 0 to 1; there are more control points than ``degree``."""
    spans = control_points - degree
    inner = tuple(index / spans for index in range(1, spans))
    return (0.0,) * (degree + 1) + inner + (1.0,) * (degree + 1)
