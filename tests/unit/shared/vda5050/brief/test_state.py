from __future__ import annotations

import pytest
from msgspec.structs import fields

from nena_shared.vda5050.brief.state import StateBrief, VisualizationBrief


@pytest.mark.parametrize("kind", [StateBrief, VisualizationBrief])
def test_briefs_have_the_names_of_the_neutral_messages(kind: type[StateBrief | VisualizationBrief]) -> None:
    assert {each.name for each in fields(kind)} <= set(kind.FULL.model_fields)
