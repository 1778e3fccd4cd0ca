from __future__ import annotations

import pytest

from nena_shared.plant.errors import ObjectKind
from nena_shared.plant.opentcs_xml.format_version import FormatVersion
from nena_shared.plant.opentcs_xml.notes import Notes


def test_what_is_passed_over_is_one_warning_for_each_kind_of_object() -> None:
    notes = Notes(FormatVersion.V7_0_0)
    notes.ignore(ObjectKind.POINT, "attribute 'b'")
    notes.ignore(ObjectKind.PATH, "attribute 'a'", 3)
    notes.ignore(ObjectKind.PATH, "attribute 'a'")
    assert [(each.code, each.kind, each.name, each.text) for each in notes.ignored()] == [
        ("IGNORED", ObjectKind.PATH, "", "attribute 'a' is not used (found 4 times)"),
        ("IGNORED", ObjectKind.POINT, "", "attribute 'b' is not used (found 1 times)"),
    ]
    assert (notes.errors, notes.warnings) == ([], [])


@pytest.mark.parametrize("version", FormatVersion)
def test_formats_before_6_are_old(version: FormatVersion) -> None:
    assert Notes(version).is_old is (version < FormatVersion.V6_0_0)
