"""The page's files by themselves: nothing inline, nothing from elsewhere, no words outside the catalogue."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_status_aggregator.fleet_model.condition import Condition
from nena_status_aggregator.rest.app import PANEL

SCRIPTS = sorted(PANEL.rglob("*.js"))
CATALOGUE = (PANEL / "catalogue.js").read_text(encoding="utf-8")
KEYS = set(re.findall(r'^\s+"([\w.]+)":', CATALOGUE, re.MULTILINE))
USED = re.compile(r"""(?:\bt|plural|cell)\(\s*"([\w.]+)"|data-text="([\w.]+)"|"((?:robots|orders)\.\w+)\"""")


class Page(HTMLParser):
    """Gathers what must not be in the page."""

    def __init__(self) -> None:
        super().__init__()
        self.inline: list[str] = []
        self._tag = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._tag = tag
        self.inline += [f"{tag} {name}" for name, _ in attrs if name == "style" or name.startswith("on")]

    def handle_data(self, data: str) -> None:
        if self._tag in ("script", "style") and data.strip():
            self.inline.append(data)


def test_there_is_nothing_inline() -> None:
    page = Page()
    page.feed((PANEL / "index.html").read_text(encoding="utf-8"))
    assert page.inline == []


@pytest.mark.parametrize("path", sorted(PANEL.rglob("*.*")), ids=lambda path: path.name)
def test_nothing_comes_from_another_host(path: Path) -> None:
    foreign = re.findall(r"https?://[^\s\"')]+", path.read_text(encoding="utf-8"))
    assert [each for each in foreign if each != "http://www.w3.org/2000/svg"] == []


def test_every_text_that_is_used_is_in_the_catalogue() -> None:
    sources = [path.read_text(encoding="utf-8") for path in (*SCRIPTS, PANEL / "index.html")]
    used = {next(filter(None, groups)) for source in sources for groups in USED.findall(source)}
    missing = [
        key for key in used if key not in KEYS and not any(each.startswith(f"{key}.") for each in KEYS)
    ]
    assert len(used) > 30
    assert missing == []


def test_every_condition_and_state_has_its_word() -> None:
    wanted = {f"condition.{each}" for each in Condition} | {f"state.{each}" for each in TransportOrderState}
    assert wanted - KEYS == set()


def test_every_condition_has_its_colour() -> None:
    style = (PANEL / "style.css").read_text(encoding="utf-8")
    painter = (PANEL / "map" / "painter.js").read_text(encoding="utf-8")
    for condition in Condition:
        assert f"--{condition.lower()}: light-dark(" in style
        assert f'"{condition.lower()}"' in painter
