from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import pytest
from pydantic import BaseModel, TypeAdapter, ValidationError

from nena_shared.vda5050.wire_names import Absent, always, reads, writes


class Light(StrEnum):
    RED = "RED"
    GREEN = "GREEN"
    AMBER = "AMBER"


READ: TypeAdapter[Light] = TypeAdapter(Annotated[Light, reads({"stop": "RED"})])
WRITTEN: TypeAdapter[Light] = TypeAdapter(Annotated[Light, writes({"AMBER": "RED"}, Light)])


class Form(BaseModel):
    lamp: Absent = None
    number: Annotated[int, always(3)] = 3


def test_names_of_the_version_are_read_and_neutral_ones_too() -> None:
    assert READ.validate_python("stop") is Light.RED
    assert READ.validate_python("GREEN") is Light.GREEN
    with pytest.raises(ValidationError):
        READ.validate_python("go")


def test_values_are_written_in_the_versions_words_and_only_in_them() -> None:
    assert [WRITTEN.dump_json(each) for each in Light] == [b'"RED"', b'"GREEN"', b'"RED"']
    assert WRITTEN.json_schema(mode="serialization")["enum"] == ["RED", "GREEN"]


def test_a_field_that_the_version_lacks_is_neither_read_nor_written() -> None:
    form = Form.model_validate({"lamp": "on", "number": 9})

    assert (form.lamp, form.number) == (None, 3)
    assert form.model_dump(mode="json") == {"number": 3}
