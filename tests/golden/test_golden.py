"""What other programs rely on stays: REST and MQTT bodies, paths, topics, settings, metrics and roles."""

from __future__ import annotations

import json
from typing import Any

import pytest

from golden.outside import FOLDER, documents, file_of, text_of

GROWING = ("settings", "metrics")
"""New ones break nobody."""

NAMES = sorted(path.stem for path in FOLDER.glob("*.json"))


@pytest.fixture(scope="module")
def present() -> dict[str, Any]:
    return documents()


def test_each_document_has_its_file(present: dict[str, Any]) -> None:
    assert sorted(present) == NAMES


@pytest.mark.parametrize("name", [each for each in NAMES if each not in GROWING])
def test_interface_is_unchanged(name: str, present: dict[str, Any]) -> None:
    expected = json.loads(file_of(name).read_text(encoding="utf-8"))
    assert json.loads(text_of(present[name])) == expected, (
        "if intended: PYTHONPATH=tests python -m golden.outside, and a line in CHANGELOG.md"
    )


def test_settings_keep_their_names(present: dict[str, Any]) -> None:
    for program, names in json.loads(file_of("settings").read_text(encoding="utf-8")).items():
        assert set(names) <= set(present["settings"][program]), program


def test_metrics_keep_their_names_and_types(present: dict[str, Any]) -> None:
    for program, kept in json.loads(file_of("metrics").read_text(encoding="utf-8")).items():
        assert kept.items() <= present["metrics"][program].items(), program
