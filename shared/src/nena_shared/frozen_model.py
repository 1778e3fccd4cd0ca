"""The base of models that never change."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class FrozenModel(BaseModel):
    """An immutable model."""

    model_config = ConfigDict(frozen=True)
