from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.plant.lif.ids import distinct_ids


@pytest.mark.parametrize(
    ("wanted", "ids"),
    [
        ({"A": "1", "B": None}, {"A": "1", "B": "B"}),
        ({"A": "", "B": "1"}, {"A": "A", "B": "1"}),
        ({"A": "1", "B": "1", "C": "2"}, {"A": "A", "B": "B", "C": "2"}),
        ({"A": "B", "B": None}, {"A": "A", "B": "B"}),
        ({"A": "B", "B": "A"}, {"A": "B", "B": "A"}),
        ({"A": "1", "B": "1", "C": "A"}, {"A": "A", "B": "B", "C": "C"}),
    ],
)
def test_an_id_is_kept_where_nobody_else_has_it(wanted: dict[str, str | None], ids: dict[str, str]) -> None:
    assert distinct_ids(wanted) == ids


@given(st.dictionaries(st.sampled_from("ABCDE"), st.none() | st.sampled_from(["", *"ABCDE12"])))
def test_ids_are_distinct_and_each_is_the_wanted_one_or_the_name(wanted: dict[str, str | None]) -> None:
    ids = distinct_ids(wanted)
    assert list(ids) == list(wanted)
    assert len(set(ids.values())) == len(ids)
    assert all(each and each in (wanted[name], name) for name, each in ids.items())
