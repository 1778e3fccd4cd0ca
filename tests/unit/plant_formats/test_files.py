from __future__ import annotations

import json
from io import BytesIO
from zipfile import ZipFile

import pytest

from nena_plant_formats import opentcs_xml as xml_format
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
        (b"Dear all", "MALFORMED_XML"),
        (b"{", "MALFORMED_JSON"),
        (b'{"name": 7, "points": []}', "BAD_VALUE"),
        (b'{"a":' * 300 + b"1" + b"}" * 300, "LIMIT_EXCEEDED"),
    ],
)
def test_other_file_is_refused(data: bytes, code: str) -> None:
    with pytest.raises(PlantModelError) as caught:
        read(data)
    assert caught.value.problems[0].code == code


def test_a_bad_value_is_quoted_and_a_missing_one_is_not() -> None:
    with pytest.raises(PlantModelError) as caught:
        read(b'{"points": {"A": {"xMm": 0}}}')
    assert [each.text for each in caught.value.problems] == [
        "name: is missing",
        'points: Input should be a valid array (received {"A":{"xMm":0}})',
    ]


def test_strict_applies_to_lif() -> None:
    odd = lif_of(node("A", colour="red"))
    assert read(odd).model.points
    with pytest.raises(PlantModelError):
        read(odd, strict=True)


def zipped() -> bytes:
    file = BytesIO()
    with ZipFile(file, "w") as archive:
        archive.writestr("hall.xml", FILES[PlantFormat.OPENTCS])
    return file.getvalue()


GRAPH = {
    "type": "FeatureCollection",
    "name": "hall",
    "features": [{"type": "Feature", "properties": {"id": 0}, "geometry": None}],
}
SITE = {"format_version": "0.1", "properties": {"name": "office"}, "levels": {"1": {"anchors": {}}}}
MAP = {"header": {"mapName": "hall"}, "advancedPointList": [], "advancedCurveList": []}
STATE = {"headerId": 1, "manufacturer": "ACME", "serialNumber": "7", "orderId": ""}
WEB_API = {"name": "hall", "points": [{"name": "A", "position": {"x": 0, "y": 0, "z": 0}}], "paths": []}
RECORDED = {"time": "2026-11-20T10:00:00Z", "topic": "uagv/v2/ACME/7/state", "payload": "{}"}
OTHERS: dict[str, bytes] = {
    "GeoJSON": json.dumps(GRAPH).encode(),
    "SEER": json.dumps(MAP).encode(),
    "Open-RMF": json.dumps(SITE, indent=1).encode(),
    "of VDA 5050": json.dumps(STATE).encode(),
    "web API": json.dumps(WEB_API).encode(),
    "MQTT message": json.dumps([RECORDED]).encode(),
    "JSON lines": b"\n".join([json.dumps(RECORDED).encode()] * 2),
    "'version', 'scripts'": b'{"name": "x", "version": "1", "scripts": {}}',
    "JSON without an object": b"[1, 2]",
    "JSON without any fields": b"{}",
    "map_server": b"image: hall.pgm\nmode: trinary\nresolution: 0.05\norigin: [0, 0, 0]\n",
    "map_server (YAML)": b"# hall\n\nresolution: 0.05\r\norigin: [0, 0, 0]\r\nimage: hall.pgm\r\n",
    "of Open-RMF (YAML)": b"coordinate_system: reference_image\nlevels:\n  L1:\n    vertices: []\n",
    "navigation graph": b"building_name: office\ndoors: {}\n",
    "YAML": b"---\n/**:\n  ros__parameters:\n    use_sim_time: true\n",
    "settings file": b'plant = "hall.xml"\n\n[mqtt]\nhost = "broker"\n',
    "TOML": b"# agent\n[mqtt]\nhost = 'broker'\n",
    "image": b"P5\n# map\n2 2\n255\n\x00\x00\xff\xff",
    "an image": b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR",
    "this is an image": b"\xff\xd8\xff\xe0\x00\x10JFIF",
    "CAD": b"  0\r\nSECTION\r\n  2\r\nHEADER\r\n",
    "CAD drawing": b"999\nmade by hand\n0\nSECTION\n2\nENTITIES\n",
    "ZIP archive": zipped(),
    "unpack": b"\x1f\x8b\x08\x00",
    "web page": b"<!DOCTYPE html>\n<html><body>404</body></html>",
    "git lfs pull": b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 1\n",
    "UTF-16": FILES[PlantFormat.NENA].decode().encode("utf-16"),
    "as UTF-8": FILES[PlantFormat.LIF].decode().encode("utf-16-be"),
    "OpenAPI": b'{"openapi": "3.0.0", "info": {"title": "x"}, "paths": {}}',
    "HTTP interface": b'{"swagger": "2.0", "info": {"title": "x"}, "paths": {}}',
    "empty": b"",
    "empty file": b" \n",
    "'tcsOrderSet'": b'<?xml version="1.0"?><tcsOrderSet><order/></tcsOrderSet>',
    "'svg'": b'<svg><path d="M0 0"/></svg>',
}


@pytest.mark.parametrize("name", OTHERS)
def test_file_that_is_no_plant_model_is_named(name: str) -> None:
    with pytest.raises(PlantModelError) as caught:
        read(OTHERS[name])
    (problem,) = caught.value.problems
    assert problem.code == "NOT_A_PLANT_MODEL"
    assert name in problem.text


@pytest.mark.parametrize(
    ("encoding", "declared", "name"),
    [
        ("utf-16", "utf-16", "Hölle"),
        ("utf-16", "UTF-8", "Hölle"),
        ("utf-8-sig", "UTF-8", "Hölle"),
        ("iso-8859-1", "ISO-8859-1", "Hölle"),
        ("gbk", "GBK", "工厂"),
        ("gb18030", "gb18030", "工厂"),
        ("shift_jis", "Shift_JIS", "工場"),
    ],
)
def test_xml_in_another_encoding_is_read(encoding: str, declared: str, name: str) -> None:
    text = FILES[PlantFormat.OPENTCS].decode().split("?>")[-1].replace('name="test"', f'name="{name}"')
    data = f'<?xml version="1.0" encoding="{declared}"?>{text}'.encode(encoding)
    assert read(data).model.name == name


def test_xml_in_another_encoding_than_stated_is_refused_with_the_reason() -> None:
    with pytest.raises(PlantModelError, match="not in the encoding that it states"):
        read('<?xml version="1.0" encoding="UTF-8"?><model version="7.0.0" name="Hölle"/>'.encode("latin-1"))


@pytest.mark.parametrize(
    ("written", "otherwise"),
    [
        ('type="HALT_POSITION"', 'type="halt_position"'),
        ('connectionType="DIRECT"', 'connectionType="Direct"'),
        ('locked="false"', 'locked="False"'),
        ('version="7.0.0"', 'version="7.0"'),
        ('maxVelocity="1000"', 'maxVelocity="1000.0"'),
        ("<?xml", "\n<?xml"),
    ],
)
def test_xml_with_one_meaning_is_read(written: str, otherwise: str) -> None:
    data = xml_format.write(PLANT).data.decode()
    assert written in data
    assert read(data.replace(written, otherwise).encode()).model == read(data.encode()).model


def test_unknown_fields_of_own_json_are_reported() -> None:
    content = json.loads(FILES[PlantFormat.NENA])
    content["crs"] = {"type": "name"}
    for each in content["paths"]:
        each["maxSpeed"] = 1.0
    ignored = [each.text for each in read(json.dumps(content).encode()).warnings if each.code == "IGNORED"]
    assert ignored == [
        "unknown field 'crs' is ignored (found 1 times)",
        "unknown field 'maxSpeed' is ignored (found 2 times)",
    ]


@pytest.mark.parametrize("kind", [PlantFormat.LIF, PlantFormat.NENA])
def test_key_that_an_object_has_twice_is_named(kind: PlantFormat) -> None:
    field = b'"layoutVersion"' if kind is PlantFormat.LIF else b'"name"'
    assert field in FILES[kind]
    twice = FILES[kind].replace(field, field + b': "other", ' + field, 1)
    (found,) = (each for each in read(twice).warnings if each.code == "REPEATED_KEY")
    assert field.decode().strip('"') in found.text
    assert read(twice).model == read(FILES[kind]).model


def test_lif_with_numbers_as_vehicle_types_is_read() -> None:
    """With a warning for each field."""
    content = json.loads(FILES[PlantFormat.LIF])
    for key, place in (("nodes", "vehicleTypeNodeProperties"), ("edges", "vehicleTypeEdgeProperties")):
        for each in content["layouts"][0][key]:
            each[place][0]["vehicleTypeId"] = 7
    report = read(json.dumps(content).encode())
    assert {use.vehicle_type_id for point in report.model.points for use in point.vehicle_types} == {"7"}
    assert any("vehicleTypeId" in each.text for each in report.warnings)


@pytest.mark.parametrize("value", [None, 7])
def test_lif_with_no_object_where_one_belongs_is_refused_in_plain_words(value: int | None) -> None:
    content = json.loads(FILES[PlantFormat.LIF])
    content["layouts"][0]["nodes"][0] = value
    with pytest.raises(PlantModelError) as caught:
        read(json.dumps(content).encode())
    assert "layouts.0.nodes.0" in caught.value.problems[0].text
    assert "should be an object" in caught.value.problems[0].text
