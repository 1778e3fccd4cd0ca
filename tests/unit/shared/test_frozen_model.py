"""Copies of frozen models are those of pydantic, at a fraction of the work."""

from __future__ import annotations

from datetime import UTC, datetime

from pydantic import BaseModel

from nena_shared.frozen_model import FrozenModel
from support.operations import calls_of


class Part(FrozenModel):
    """A part of a model."""

    name: str
    tags: tuple[str, ...] = ()


class Usual(BaseModel):
    """The same fields as :class:`Whole`, copied by pydantic."""

    number: int
    part: Part
    at: datetime | None = None


class Whole(FrozenModel):
    """A model with a part."""

    number: int
    part: Part
    at: datetime | None = None


WHOLE = Whole(number=1, part=Part(name="one"))


def test_a_copy_has_the_changes_and_shares_the_rest() -> None:
    copy = WHOLE.model_copy(update={"at": datetime(2026, 1, 1, tzinfo=UTC)})
    assert copy == Whole(number=1, part=WHOLE.part, at=datetime(2026, 1, 1, tzinfo=UTC))
    assert copy.part is WHOLE.part
    assert copy.model_fields_set == {"number", "part", "at"}
    assert WHOLE.at is None
    assert WHOLE.model_fields_set == {"number", "part"}


def test_a_copy_is_a_whole_model() -> None:
    copy = WHOLE.model_copy(update={"number": 2})
    assert Whole.model_validate_json(copy.model_dump_json()) == copy
    assert copy.model_copy(deep=True) == copy
    assert copy.model_copy(deep=True).part is not copy.part


def test_a_copy_takes_less_than_half_of_the_work() -> None:
    usual = Usual(number=1, part=WHOLE.part)
    of_pydantic = calls_of(lambda: usual.model_copy(update={"number": 2}))
    assert calls_of(lambda: WHOLE.model_copy(update={"number": 2})) < of_pydantic / 2
