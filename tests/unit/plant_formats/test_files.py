from __future__ import annotations

import pytest

from nena_plant_formats.files import PlantFormat, format_of, read
from nena_shared.plant import PlantModelError
from support.lif_files import edge, lif_of, node
from support.plants import opentcs_xml, path, plant

PLANT = plant(path("A B"), path("B A"))
FILES = {
    PlantFormat.OPENTCS: opentcs_xml("", name="test"),
    PlantFormat.LIF: lif_of(node("A"), node("B"), edge("A B"), edge("B A")),
    PlantFormat.NENA: PLANT.to_json().encode(),
}


@pytest.mark.parametrize("kind", FILES)
@pytest.mark.parametrize("before", [b"", b"\xef\xbb\xbf"])
def test_format_is_detected_by_content(kind: PlantFormat, before: bytes) -> None:
    assert format_of(before + FILES[kind]) is kind
    assert read(before + FILES[kind]).model.name in {"test", "plant"}


def test_own_json_is_checked_as_files_of_others_are() -> None:
    report = read(FILES[PlantFormat.NENA])
    assert report.model == PLANT
    assert [problem.code for problem in report.warnings] == ["NO_PARK_POSITION"]
    broken = PLANT.model_copy(update={"points": ()}).to_json().encode()
    with pytest.raises(PlantModelError) as caught:
        read(broken)
    assert {problem.code for problem in caught.value.problems} == {"UNKNOWN_REFERENCE"}


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"", "MALFORMED_XML"),
        (b"Dear all", "MALFORMED_XML"),
        (b"{", "MALFORMED_JSON"),
        (b"[1, 2]", "BAD_VALUE"),
        (b'{"name": 7}', "BAD_VALUE"),
        (b'{"a":' * 300 + b"1" + b"}" * 300, "LIMIT_EXCEEDED"),
    ],
)
def test_other_file_is_refused(data: bytes, code: str) -> None:
    with pytest.raises(PlantModelError) as caught:
        read(data)
    assert caught.value.problems[0].code == code


def test_strict_applies_to_lif() -> None:
    odd = lif_of(node("A", colour="red"))
    assert read(odd).model.points
    with pytest.raises(PlantModelError):
        read(odd, strict=True)
