"""One version in every place of a release."""

from __future__ import annotations

import re
import tomllib
from importlib.metadata import version
from pathlib import Path

import pytest

from support.stores import STORES

ROOT = Path(__file__).parents[2]
RELEASE = version("nena-shared")
DISTRIBUTIONS = sorted(
    each for each in ROOT.glob("*/**/pyproject.toml") if not {".venv", "build"} & set(each.parts)
)
PLACES = {
    "services/edge_agent/package.xml": r"<version>(.*?)</version>",
    "deploy/kubernetes/kustomization.yaml": r"newTag: (.*)",
    "docs/kubernetes.md": r"-t nena/[a-z-]+:(\S+)",
    **{
        str(each.relative_to(ROOT)): r'image\.version="(.*?)"'
        for each in sorted((ROOT / "services").glob("*/Dockerfile*"))
    },
}


@pytest.mark.parametrize("path", DISTRIBUTIONS, ids=lambda path: path.parent.name)
def test_distribution_has_the_version_of_the_release(path: Path) -> None:
    assert tomllib.loads(path.read_text(encoding="utf-8"))["project"]["version"] == RELEASE


@pytest.mark.parametrize("place", PLACES)
def test_place_names_the_version_of_the_release(place: str) -> None:
    found = re.findall(PLACES[place], (ROOT / place).read_text(encoding="utf-8"))
    assert found
    assert set(found) == {RELEASE}


def test_release_has_notes_and_a_store_to_upgrade_from() -> None:
    headings = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert headings[:2] == ["Unreleased", RELEASE]
    assert (STORES / f"{RELEASE}.sql").exists()
