"""Copies of frozen models are those of pydantic, at a fraction of the work."""

from __future__ import annotations

from nena_shared.frozen_model import FrozenModel


class Part(FrozenModel):
    """A part of a model."""

    name: str


class Whole(FrozenModel):
    """A model with a part."""

    number: int
    part: Part
    note: str | None = None


WHOLE = Whole(number=1, part=Part(name="one"))


def test_a_copy_has_the_changes_and_shares_the_rest() -> None:
    copy = WHOLE.model_copy(update={"note": "new"})
    assert copy == Whole(number=1, part=WHOLE.part, note="new")
    assert copy.part is WHOLE.part
    assert copy.model_fields_set == {"number", "part", "note"}
    assert WHOLE.note is None
    assert WHOLE.model_fields_set == {"number", "part"}


def test_a_copy_is_a_whole_model() -> None:
    copy = WHOLE.model_copy(update={"number": 2})
    assert Whole.model_validate_json(copy.model_dump_json()) == copy
    assert copy.model_copy(deep=True) == copy
    assert copy.model_copy(deep=True).part is not copy.part
