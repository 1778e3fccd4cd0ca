"""Errors of 2.1 (section 6.10.5 and 7.1)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Final, Self

from pydantic import ValidationInfo, field_serializer, model_validator

from nena_shared.vda5050.base import WireObject
from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorReference
from nena_shared.vda5050.v2_1.error_type import REJECTIONS, WRITTEN
from nena_shared.vda5050.v2_1.parameter import neutral_path, written_path
from nena_shared.vda5050.wire_names import Absent, writes

PARAMETER: Final = "parameter"
"""The key under which the value names a parameter."""


class ErrorReferenceV21(ErrorReference):
    """What an error is about; parameters of the order have their 2.x names, as key or as value."""

    @staticmethod
    def finish_record(record: Any) -> Mapping[str, object]:  # noqa: ANN401 - it has the fields of the form
        """Return the neutral names."""
        key, value = neutral_path(record.reference_key), record.reference_value
        return {"reference_key": key, "reference_value": neutral_path(value) if key == PARAMETER else value}

    @model_validator(mode="after")
    def _read(self, info: ValidationInfo) -> Self:
        return self.model_copy(update=self.finish_record(self)) if info.mode == "json" else self

    @field_serializer("reference_key", when_used="json")
    def _written_key(self, key: str) -> str:
        return written_path(key)

    @field_serializer("reference_value", when_used="json")
    def _written_value(self, value: str) -> str:
        return written_path(value) if self.reference_key == PARAMETER else value


class ErrorEntryV21(ErrorEntry):
    """An error; 2.1 knows the levels WARNING and FATAL, and names of its own."""

    error_level: Annotated[ErrorLevel, writes({"URGENT": "WARNING", "CRITICAL": "FATAL"}, ErrorLevel)]
    error_references: tuple[ErrorReferenceV21, ...] = ()
    error_description_translations: Absent = None
    error_hint_translations: Absent = None

    @classmethod
    def from_neutral(cls, neutral: WireObject) -> Self:
        """Make the 2.1 form: a rejection is always a warning, what stops the robot is fatal."""
        error = ErrorEntry.model_validate(neutral, by_name=True, by_alias=False)
        mild = error.error_level in (ErrorLevel.WARNING, ErrorLevel.URGENT) or error.error_type in REJECTIONS
        return cls.model_validate(
            error.model_copy(
                update={
                    "error_type": WRITTEN.get(error.error_type, error.error_type),
                    "error_level": ErrorLevel.WARNING if mild else ErrorLevel.FATAL,
                }
            ),
            by_name=True,
            by_alias=False,
        )
