from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from nena_shared.plant.errors import ObjectKind
from nena_shared.plant.lif.names import Names


def test_who_comes_first_is_called_by_its_id_and_the_others_by_their_kind_and_a_number() -> None:
    names = Names(["A"])
    assert names.take(ObjectKind.PATH, "B", "edge") == "B"
    assert names.renamed == []
    assert names.take(ObjectKind.PATH, "A", "edge") == "edge:A"
    assert names.take(ObjectKind.LOCATION, "A", "edge") == "edge2:A"
    assert [(each.kind, each.name) for each in names.renamed] == [
        (ObjectKind.PATH, "A"),
        (ObjectKind.LOCATION, "A"),
    ]
    assert "'edge2:A'" in names.renamed[1].text


@given(st.lists(st.sampled_from(["A", "B", "edge:A", "edge2:A", "edge:edge:A"])))
def test_no_name_is_given_twice(wanted: list[str]) -> None:
    names = Names(["A"])
    given_names = [names.take(ObjectKind.PATH, each, "edge") for each in wanted]
    assert len({"A", *given_names}) == len(wanted) + 1
    renamed = [one for one, other in zip(wanted, given_names, strict=True) if one != other]
    assert [each.name for each in names.renamed] == renamed
