"""Any file content gives a model that survives JSON, or a PlantModelError, and nothing else."""

import re
from contextlib import suppress

from hypothesis import given, settings
from hypothesis import strategies as st

from nena_demo.plants import sample_plant_path
from nena_plant_formats.opentcs_xml import read
from nena_shared.plant import PlantModel, PlantModelError
from support.examples import DAMAGED_FILES

TEXT = sample_plant_path().read_text(encoding="utf-8")
VALUES = [match.span(1) for match in re.finditer(r'="([^"]*)"', TEXT)]
ODD = st.sampled_from(
    [
        "",
        " ",
        "0",
        "-1",
        "1e400",
        "NaN",
        "inf",
        "9" * 18,
        "9" * 5000,
        "true",
        "BEZIER",
        "Middle 1",
        "0.0.2",
        "6.0.0",
    ]
)
ANYTHING = ODD | st.text(st.characters(exclude_characters='"<&', exclude_categories=["Cs", "Cc"]))


def assert_read_or_refused(text: str | bytes) -> None:
    data = text.encode() if isinstance(text, str) else text
    with suppress(PlantModelError):
        model = read(data).model
        assert PlantModel.from_json(model.to_json()) == model


@settings(max_examples=DAMAGED_FILES)
@given(st.lists(st.tuples(st.integers(0, len(VALUES) - 1), ANYTHING), min_size=1, max_size=4))
def test_any_value_in_any_attribute(changes: list[tuple[int, str]]) -> None:
    text = TEXT
    for index, value in sorted(dict(changes).items(), reverse=True):
        start, end = VALUES[index]
        text = text[:start] + value + text[end:]
    assert_read_or_refused(text)


@settings(max_examples=DAMAGED_FILES)
@given(st.integers(0, len(TEXT)), st.integers(0, 200), st.binary(max_size=20))
def test_any_bytes_in_any_place(start: int, length: int, noise: bytes) -> None:
    data = TEXT.encode()
    assert_read_or_refused(data[:start] + noise + data[start + length :])


@settings(max_examples=DAMAGED_FILES)
@given(st.lists(st.integers(0, TEXT.count("\n") - 1), max_size=20))
def test_any_lines_missing(numbers: list[int]) -> None:
    lines = TEXT.splitlines()
    assert_read_or_refused("\n".join(line for number, line in enumerate(lines) if number not in numbers))
