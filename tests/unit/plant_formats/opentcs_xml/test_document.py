"""What is read of one element, and what is noted where it is wrong."""

from __future__ import annotations

import time
from collections.abc import Callable
from enum import StrEnum
from math import inf, isfinite
from typing import Any
from xml.etree.ElementTree import Element, SubElement

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_plant_formats.opentcs_xml import Limits, read
from nena_plant_formats.opentcs_xml.document import MAX_SCALE, Findings, FormatVersion, XmlObject
from nena_shared.plant import PlantModelError
from nena_shared.plant.errors import ObjectKind

DTD = b'<!DOCTYPE model [<!ENTITY a "aaaa">]>'
EXTERNAL = b'<!DOCTYPE model SYSTEM "file:///etc/passwd">'
BODY = b'<model version="7.0.0" name="m"><a><b/></a></model>'


def refusal(data: bytes, limits: Limits | None = None) -> str:
    with pytest.raises(PlantModelError) as caught:
        read(data, limits=limits or Limits())
    (problem,) = caught.value.problems
    return problem.code


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"", "MALFORMED_XML"),
        (b"{}", "MALFORMED_XML"),
        (b'<model version="7.0.0"', "MALFORMED_XML"),
        (b'<?xml version="1.0" encoding="no-such"?>' + BODY, "MALFORMED_XML"),
        (b"<model>\xff</model>", "MALFORMED_XML"),
        (b"<html/>", "NOT_A_PLANT_MODEL"),
        (b'<model xmlns="urn:other" version="7.0.0" name="m"/>', "NOT_A_PLANT_MODEL"),
        (DTD + BODY, "FORBIDDEN_XML"),
        (EXTERNAL + BODY, "FORBIDDEN_XML"),
        (b'<model name="m"/>', "UNSUPPORTED_VERSION"),
    ],
)
def test_other_file_is_refused(data: bytes, code: str) -> None:
    assert refusal(data) == code


@pytest.mark.parametrize(
    ("limits", "good"),
    [
        (Limits(size_bytes=len(BODY) - 1), Limits(size_bytes=len(BODY))),
        (Limits(depth=2), Limits(depth=3)),
        (Limits(elements=2), Limits(elements=3)),
    ],
)
def test_each_limit_stops_the_reader(limits: Limits, good: Limits) -> None:
    assert refusal(BODY, limits) == "LIMIT_EXCEEDED"
    assert read(BODY, limits=good).model.name == "m"


def test_a_file_of_a_million_nested_elements_is_stopped_early() -> None:
    assert refusal(b"<model>" + b"<a>" * 1_000_000) == "LIMIT_EXCEEDED"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_very_many_attributes_are_refused_before_the_parser_sees_them(encoding: str) -> None:
    """The parser took four seconds for these, and longer by the square of their number."""
    attributes = " ".join(f'a{number}="1"' for number in range(200_000))
    start = time.process_time()

    assert refusal(f"<model {attributes}/>".encode(encoding)) == "LIMIT_EXCEEDED"
    assert time.process_time() - start < 2.0


@pytest.mark.parametrize(
    ("text", "version"),
    [
        ("0.0.2", FormatVersion.V0_0_2),
        ("0.0.3", FormatVersion.V0_0_3),
        ("0.0.4", FormatVersion.V0_0_4),
        ("0.0.5", FormatVersion.V0_0_5),
        ("6.0.0", FormatVersion.V6_0_0),
        ("7.0.0", FormatVersion.V7_0_0),
        ("7.0.3", FormatVersion.V7_0_0),
        ("7.0", FormatVersion.V7_0_0),
        ("v7.0.0", FormatVersion.V7_0_0),
        (" 6 ", FormatVersion.V6_0_0),
    ],
)
def test_known_versions(text: str, version: FormatVersion) -> None:
    assert FormatVersion.parse(text, "m") is version


@pytest.mark.parametrize(
    "text",
    ["", "0", "0.0.0", "0.0.1", "0.0.6", "0.1.0", "1.0.0", "6.1.0", "7.1.0", "8.0.0", "60.0.0", "7.0.0-rc1"],
)
def test_other_versions_are_refused_by_name(text: str) -> None:
    with pytest.raises(PlantModelError) as caught:
        FormatVersion.parse(text, "Hall 3")
    (problem,) = caught.value.problems
    assert (problem.code, problem.name) == ("UNSUPPORTED_VERSION", "Hall 3")
    assert repr(text) in problem.text
    assert "7.0.x" in problem.text


def test_ignored_content_is_one_warning_per_kind() -> None:
    findings = Findings(FormatVersion.V7_0_0)
    findings.ignore(ObjectKind.POINT, "attribute 'b'")
    findings.ignore(ObjectKind.PATH, "attribute 'a'", 3)
    findings.ignore(ObjectKind.PATH, "attribute 'a'")
    assert [(each.code, each.kind, each.name, each.text) for each in findings.ignored()] == [
        ("IGNORED", ObjectKind.PATH, "", "attribute 'a' is ignored (found 4 times)"),
        ("IGNORED", ObjectKind.POINT, "", "attribute 'b' is ignored (found 1 times)"),
    ]
    assert (findings.errors, findings.warnings) == ([], [])


NEW, OLD = FormatVersion.V7_0_0, FormatVersion.V0_0_4


class Fruit(StrEnum):
    APPLE = "APPLE"
    PEAR = "PEAR"


def element(version: FormatVersion = NEW, **attributes: str) -> XmlObject:
    return XmlObject(Element("path", attributes), ObjectKind.PATH, "P", Findings(version))


def errors(obj: XmlObject) -> list[str]:
    assert all((each.kind, each.name) == (ObjectKind.PATH, "P") for each in obj.findings.errors)
    return [each.code for each in obj.findings.errors]


@pytest.mark.parametrize(
    ("read", "harmless"),
    [
        (lambda obj: obj.text("a"), ""),
        (lambda obj: obj.integer("a"), 0),
        (lambda obj: obj.integer("a", minimum=1), 1),
        (lambda obj: obj.boolean("a"), False),
        (lambda obj: obj.choice("a", Fruit), Fruit.APPLE),
    ],
)
def test_missing_attribute_without_a_default_is_an_error(
    read: Callable[[XmlObject], Any], harmless: object
) -> None:
    obj = element()
    assert read(obj) == harmless
    assert errors(obj) == ["MISSING_ATTRIBUTE"]
    assert "'path' needs attribute 'a'" in obj.findings.errors[0].text


@pytest.mark.parametrize(
    ("wanted", "written", "meant"),
    [
        ("positionX", {"xPosition": "1", "yPosition": "2"}, "xPosition"),
        ("xPosition", {"positionX": "1", "positionY": "2"}, "positionX"),
        ("positionX", {"positonY": "2", "positonX": "1"}, "positonX"),
        ("positionX", {"PositionX": "1"}, "PositionX"),
        ("positionX", {"position_x": "1"}, "position_x"),
        ("positionX", {"yPosition": "1"}, None),
        ("positionX", {"length": "1"}, None),
    ],
)
def test_an_attribute_that_looks_like_a_missing_one_is_named(
    wanted: str, written: dict[str, str], meant: str | None
) -> None:
    obj = element(NEW, **written)
    obj.integer(wanted)
    hint = f"; {meant!r} looks like it" if meant else ""
    assert obj.findings.errors[0].text == f"element 'path' needs attribute {wanted!r}{hint}"


@pytest.mark.parametrize(
    ("read", "default"),
    [
        (lambda obj: obj.text("a", "x"), "x"),
        (lambda obj: obj.optional_text("a"), None),
        (lambda obj: obj.integer("a", 7, minimum=9), 7),
        (lambda obj: obj.boolean("a", default=True), True),
        (lambda obj: obj.choice("a", Fruit, Fruit.PEAR), Fruit.PEAR),
        (lambda obj: obj.scale("a", 50.0), 50.0),
        (lambda obj: obj.angle("a"), None),
        (lambda obj: obj.color("a"), None),
    ],
)
def test_missing_attribute_may_have_a_default(read: Callable[[XmlObject], Any], default: object) -> None:
    obj = element()
    assert read(obj) == default
    assert errors(obj) == []
    assert obj.findings.warnings == []


@pytest.mark.parametrize(
    "text", ["", "7.5", "7e3", "1_000", "0x7", "\u0667", "--7", "9" * 16, "9" * 5000, "NaN"]
)
def test_non_integer_is_an_error(text: str) -> None:
    obj = element(a=text)
    assert obj.integer("a", 5) == 5
    assert errors(obj) == ["BAD_VALUE"]
    assert obj.findings.errors[0].text.endswith("it must be a whole number")


@pytest.mark.parametrize(
    ("text", "bounds", "wanted"),
    [
        ("0", {"minimum": 1}, "at least 1"),
        ("101", {"minimum": 0, "maximum": 100}, "between 0 and 100"),
        ("-1", {"minimum": 0, "maximum": 100}, "between 0 and 100"),
    ],
)
def test_number_out_of_bounds_error_states_the_bounds(text: str, bounds: Any, wanted: str) -> None:
    obj = element(a=text)
    assert obj.integer("a", 50, **bounds) == 50
    assert errors(obj) == ["BAD_VALUE"]
    assert wanted in obj.findings.errors[0].text


@pytest.mark.parametrize("text", ["0", "-1", "NaN", "inf", "wide", str(MAX_SCALE + 1)])
def test_a_scale_is_finite_and_above_zero(text: str) -> None:
    obj = element(a=text)
    assert obj.scale("a", 50.0) == 50.0
    assert errors(obj) == ["BAD_VALUE"]
    right = element(a=str(MAX_SCALE))
    assert right.scale("a", 50.0) == MAX_SCALE
    assert errors(right) == []


@pytest.mark.parametrize(
    ("text", "angle", "found"),
    [
        ("90.5", 90.5, []),
        ("NaN", None, []),
        ("Infinity", None, ["BAD_VALUE"]),
        ("north", None, ["BAD_VALUE"]),
    ],
)
def test_an_angle_is_a_number_or_none(text: str, angle: float | None, found: list[str]) -> None:
    obj = element(a=text)
    assert obj.angle("a") == angle
    assert errors(obj) == found


@pytest.mark.parametrize(
    ("text", "value", "found"),
    [
        ("true", True, []),
        ("1", True, []),
        ("false", False, []),
        ("0", False, []),
        ("True", True, []),
        ("FALSE", False, []),
        ("yes", False, ["BAD_VALUE"]),
        ("", False, ["BAD_VALUE"]),
    ],
)
def test_truth_is_written_as_xml_has_it(text: str, value: bool, found: list[str]) -> None:  # noqa: FBT001 - an example
    obj = element(a=text)
    assert obj.boolean("a", default=True) is value
    assert errors(obj) == found


def test_a_value_of_another_list_is_an_error_and_one_that_was_renamed_is_not_in_old_files() -> None:
    renamed = {"MELON": Fruit.PEAR}
    old = element(OLD, a="MELON")
    assert old.choice("a", Fruit, renamed=renamed) is Fruit.PEAR
    assert ([each.code for each in old.findings.warnings], errors(old)) == (["VALUE_REPLACED"], [])

    new = element(NEW, a="MELON")
    assert new.choice("a", Fruit, renamed=renamed) is Fruit.APPLE
    assert ([each.code for each in new.findings.warnings], errors(new)) == ([], ["BAD_VALUE"])
    assert "one of APPLE, PEAR" in new.findings.errors[0].text


@pytest.mark.parametrize(
    ("text", "kept"), [("#A0b1C2", True), ("#A0b1C", False), ("red", False), ("", False)]
)
def test_invalid_colour_is_only_a_warning(text: str, kept: bool) -> None:  # noqa: FBT001 - an example
    obj = element(a=text)
    assert obj.color("a") == (text if kept else None)
    assert [each.code for each in obj.findings.warnings] == ([] if kept else ["DRAWING_DROPPED"])
    assert errors(obj) == []


def test_only_old_formats_may_omit_newer_attributes() -> None:
    assert element(OLD).if_old(7) == 7
    assert element(NEW).if_old(7) is None


def test_of_two_properties_with_one_name_the_last_counts() -> None:
    root = Element("path")
    for key, value in (("a", "1"), ("b", "2"), ("a", "3")):
        SubElement(root, "property", name=key, value=value)
    SubElement(root, "property", name="c")
    obj = XmlObject(root, ObjectKind.PATH, "P", Findings(NEW))
    assert obj.properties() == {"a": "3", "b": "2", "c": ""}
    assert [each.code for each in obj.findings.warnings] == ["DUPLICATE_PROPERTY"]
    assert obj.properties() == {}, "children are read once"


def test_findings_are_attributed_to_their_object() -> None:
    root = Element("model")
    SubElement(SubElement(root, "path", name="Q"), "hop")
    SubElement(root, "path")
    model = XmlObject(root, ObjectKind.MODEL, "m", Findings(NEW))
    for path in model.objects("path", ObjectKind.PATH):
        for hop in path.children("hop"):
            hop.text("name")
    assert [(each.code, each.kind, each.name) for each in model.findings.errors] == [
        ("MISSING_ATTRIBUTE", ObjectKind.PATH, "Q"),
        ("MISSING_ATTRIBUTE", ObjectKind.PATH, ""),
    ]


def test_ignored_content_is_reported_with_its_count() -> None:
    root = Element("model")
    for _ in range(3):
        SubElement(SubElement(root, "path", name="Q", colour="red", empty=""), "hop")
    model = XmlObject(root, ObjectKind.MODEL, "m", Findings(NEW))
    list(model.objects("path", ObjectKind.PATH))
    model.finish()
    assert [each.text for each in model.findings.ignored()] == [
        "attribute 'colour' of element 'path' is ignored (found 3 times)",
        "element 'hop' in 'path' is ignored (found 3 times)",
    ]


@given(st.text(max_size=20), st.sampled_from(FormatVersion))
def test_any_value_is_read_as_a_harmless_one(text: str, version: FormatVersion) -> None:
    obj = element(version, a=text)
    assert 0 <= obj.integer("a", 5, minimum=0, maximum=10) <= 10
    assert 0 < obj.scale("a", 50.0) <= MAX_SCALE
    assert isfinite(obj.angle("a") or 0)
    assert obj.angle("a") != inf
    assert obj.choice("a", Fruit) in Fruit
    assert set(errors(obj)) <= {"BAD_VALUE"}
