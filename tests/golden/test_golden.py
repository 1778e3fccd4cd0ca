"""What other programs rely on stays: REST and MQTT bodies, paths, topics, settings, metrics and roles."""

from __future__ import annotations

import json
from typing import Any

import pytest

from golden.outside import FOLDER, documents, file_of, text_of

NAMES = sorted(path.stem for path in FOLDER.glob("*.json"))


@pytest.fixture(scope="module")
def present() -> dict[str, Any]:
    return documents()


def test_each_document_has_its_file(present: dict[str, Any]) -> None:
    assert sorted(present) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_it_is_as_it_was(name: str, present: dict[str, Any]) -> None:
    expected = json.loads(file_of(name).read_text(encoding="utf-8"))
    assert json.loads(text_of(present[name])) == expected
