from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.vda5050.v2_1.order import ActionV21
from nena_shared.vda5050.v2_1.parameter import (
    WRITTEN,
    has_segment_in,
    missing_names,
    neutral_path,
    written_path,
)

NAMES = st.sampled_from([*WRITTEN, "order", "nodes", "edges", "x"])
PATHS = st.lists(NAMES, min_size=1, max_size=4).map(".".join)


def test_different_names_are_written_in_those_of_the_version() -> None:
    assert written_path("order.edges.maximumSpeed") == "order.edges.maxSpeed"
    assert neutral_path("order.edges.maxSpeed") == "order.edges.maximumSpeed"


@given(PATHS)
def test_parameter_path_round_trip(path: str) -> None:
    assert neutral_path(written_path(path)) == path


@pytest.mark.parametrize(("path", "speaks"), [("order.nodes.retriable", True), ("nodes.retriables", False)])
def test_only_complete_names_match(path: str, *, speaks: bool) -> None:
    assert has_segment_in(frozenset({"retriable"}), path) is speaks


def test_fields_that_the_version_does_not_have_are_missing() -> None:
    assert "retriable" in missing_names(ActionV21)
    assert "actionType" not in missing_names(ActionV21)
