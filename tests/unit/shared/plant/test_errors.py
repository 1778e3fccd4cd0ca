from __future__ import annotations

from nena_shared.plant.errors import ObjectKind, PlantModelError, PlantProblem, UnknownObjectError


def test_error_lists_all_problems_with_their_objects() -> None:
    problems = [
        PlantProblem("A", ObjectKind.POINT, "P1", "no"),
        PlantProblem("B", ObjectKind.PATH, "P2", "not"),
    ]

    error = PlantModelError(iter(problems))

    assert error.problems == tuple(problems)
    assert "2 error(s)" in str(error)
    assert "point 'P1': no [A]" in str(error)
    assert "path 'P2': not [B]" in str(error)


def test_finding_about_an_unnamed_object_omits_the_name() -> None:
    assert str(PlantProblem("A", ObjectKind.MODEL, "", "no XML")) == "model: no XML [A]"


def test_unknown_name_suggests_similar_ones() -> None:
    error = UnknownObjectError(ObjectKind.POINT, "Dok 1", ["Dock 1", "Storage"])

    assert (error.kind, error.name, error.suggestions) == (ObjectKind.POINT, "Dok 1", ("Dock 1",))
    assert str(error) == "The plant model has no point 'Dok 1'. Did you mean 'Dock 1'?"


def test_a_name_like_nothing_is_only_unknown() -> None:
    assert str(UnknownObjectError(ObjectKind.BLOCK, "x")) == "The plant model has no block 'x'."
