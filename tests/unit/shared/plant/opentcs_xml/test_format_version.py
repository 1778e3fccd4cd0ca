import pytest

from nena_shared.plant import PlantModelError
from nena_shared.plant.opentcs_xml.format_version import FormatVersion


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
    ],
)
def test_known_versions(text: str, version: FormatVersion) -> None:
    assert FormatVersion.parse(text, "m") is version


@pytest.mark.parametrize(
    "text",
    ["", "7", "0.0.0", "0.0.1", "0.0.6", "0.1.0", "1.0.0", "6.1.0", "7.1.0", "8.0.0", "60.0.0", "7.0.0-rc1"],
)
def test_other_versions_are_refused_by_name(text: str) -> None:
    with pytest.raises(PlantModelError) as caught:
        FormatVersion.parse(text, "Hall 3")
    (problem,) = caught.value.problems
    assert (problem.code, problem.name) == ("UNSUPPORTED_VERSION", "Hall 3")
    assert repr(text) in problem.text
    assert "7.0.x" in problem.text
