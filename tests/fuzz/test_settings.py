"""Settings of every program, from a file, the environment and options: taken, or refused in plain words."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from functools import cache
from io import StringIO
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nena_shared.settings import ConfigurationError, load
from reference.configuration import PROGRAMS, Setting, settings_of
from support.damage import damaged_text, stream
from support.examples import DAMAGED_FILES

ROOT = Path(__file__).parents[2]
FILES = sorted(ROOT.glob("deploy/containers/demo/*.toml"))
EXAMPLES = DAMAGED_FILES // 4
"""For each program and source; reading settings is slow, as programs do it once."""
PROBLEM = 2000
"""Signs: a problem is for people, also that of something huge."""

ODD = (
    "",
    " ",
    "0",
    "-1",
    "1e400",
    "nan",
    "true",
    "null",
    "[",
    "{}",
    '{"a": [',
    "[1, 2]",
    "../..",
    "x" * 100_000,
)
TEXTS = st.sampled_from(ODD) | st.text(
    st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=20
)
NAMES = st.sampled_from(["a", "name", "x"])
VALUES: st.SearchStrategy[Any] = st.recursive(
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats() | TEXTS,
    lambda inside: st.lists(inside, max_size=3) | st.dictionaries(NAMES, inside),
    max_leaves=5,
)


def toml(value: object) -> str:
    """Write a value as TOML does."""
    match value:
        case float() if not math.isfinite(value):
            return {math.inf: "inf", -math.inf: "-inf"}.get(value, "nan")
        case list():
            return f"[{', '.join(map(toml, value))}]"
        case dict():
            return f"{{{', '.join(f'{name} = {toml(each)}' for name, each in value.items())}}}"
    return json.dumps(value).replace("\x7f", "\\u007f")


def names_of(program: str) -> st.SearchStrategy[Setting]:
    return st.sampled_from(settings_of(PROGRAMS[program]))


def problems(program: str, *arguments: str, environment: Mapping[str, str] | None = None) -> tuple[str, ...]:
    """Read the settings, and return their errors."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith("NENA_")}
    with patch.dict(os.environ, {**clean, **(environment or {})}, clear=True):
        try:
            load(PROGRAMS[program], arguments, program=program, description="")
        except ConfigurationError as error:
            return error.problems or ("nothing is said",)
    return ()


def assert_for_people(told: Sequence[str]) -> None:
    """Each problem names a setting or a file, and is a line that can be read."""
    for each in told:
        assert ": " in each, each
        assert len(each) < PROBLEM, each[:PROBLEM]
        assert each.isprintable(), each


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("settings") / "settings.toml"


@pytest.mark.parametrize("program", PROGRAMS)
@settings(max_examples=EXAMPLES)
@given(st.data())
def test_any_value_in_a_file(program: str, file: Path, data: st.DataObject) -> None:
    chosen = data.draw(st.dictionaries(names_of(program).map(lambda each: each.name), VALUES, max_size=4))
    file.write_text("".join(f"{name} = {toml(value)}\n" for name, value in chosen.items()), encoding="utf-8")

    assert_for_people(problems(program, "--config", str(file)))


@pytest.mark.parametrize("program", PROGRAMS)
@settings(max_examples=EXAMPLES)
@given(st.data())
def test_any_text_in_the_environment(program: str, data: st.DataObject) -> None:
    chosen = data.draw(st.dictionaries(names_of(program).map(lambda each: each.variable), TEXTS, max_size=4))

    assert_for_people(problems(program, environment=chosen))


@pytest.mark.parametrize("program", PROGRAMS)
@settings(max_examples=EXAMPLES)
@given(st.data())
def test_any_text_as_an_option(program: str, data: st.DataObject) -> None:
    chosen = data.draw(
        st.lists(st.tuples(names_of(program).map(lambda each: each.option), TEXTS), max_size=3)
    )
    arguments = [each for pair in chosen for each in pair]
    with suppress(SystemExit), redirect_stderr(StringIO()), redirect_stdout(StringIO()):
        assert_for_people(problems(program, *arguments))


@cache
def texts() -> tuple[bytes, ...]:
    return tuple(each.read_bytes() for each in FILES)


@pytest.mark.parametrize("program", PROGRAMS)
def test_a_damaged_file(program: str, file: Path) -> None:
    chance = stream(program)
    for _ in range(EXAMPLES):
        file.write_bytes(damaged_text(chance.choice(texts()), chance))
        assert_for_people(problems(program, "--config", str(file)))
