import pytest

from nena_shared.plant import PlantModelError
from nena_shared.plant.opentcs_xml import Limits, read

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
def test_what_is_no_plant_model_is_refused(data: bytes, code: str) -> None:
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
