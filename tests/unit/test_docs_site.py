"""The site of the docs has every page, and links and anchors resolve; `make docs` builds it."""

from __future__ import annotations

import re
from collections import Counter
from functools import cache
from importlib.util import module_from_spec, spec_from_file_location
from types import ModuleType
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]  # its stubs would be one more dependency

from support.reference import PROJECT


def _hook() -> ModuleType:
    spec = spec_from_file_location("docs_site_pages", PROJECT / "tools/docs_site/pages.py")
    assert spec
    assert spec.loader
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


HOOK = _hook()
CONFIG: dict[str, Any] = yaml.safe_load((PROJECT / "mkdocs.yml").read_text(encoding="utf-8"))
PAGES: list[str] = [*HOOK.pages_of(CONFIG["nav"]), *HOOK.decisions()]
LINK = re.compile(r"\]\(([^()\s#]*)#([^()\s]+)\)")


def text_of(file: str) -> str:
    return (PROJECT / file).read_text(encoding="utf-8")


@cache
def anchors(file: str) -> frozenset[str]:
    """Return the anchors of a file's headings, as GitHub and MkDocs make them."""
    without_code = re.sub(r"```.*?```", "", text_of(file), flags=re.DOTALL)
    found: Counter[str] = Counter()
    for heading in re.findall(r"^#+ +(.+)$", without_code, re.MULTILINE):
        plain = re.sub(r"\]\([^)]*\)", "", heading).lower()
        found[re.sub(r"[\s]", "-", re.sub(r"[^\w\s-]", "", plain).strip())] += 1
    return frozenset(found)


def test_every_page_of_the_docs_is_in_the_navigation_once() -> None:
    docs = PROJECT / "docs"
    files = {str(each.relative_to(docs)) for each in docs.rglob("*.md")}
    assert Counter(each for each in PAGES if not each.startswith(HOOK.OTHERS)) == Counter(files)


def test_navigation_separates_the_four_kinds_of_pages() -> None:
    kinds = [kind for entry in CONFIG["nav"] for kind in entry]
    assert kinds == ["Home", "Tutorials", "How-to guides", "Reference", "Explanation"]


@pytest.mark.parametrize("page", PAGES)
def test_links_of_pages_resolve(page: str) -> None:
    file = HOOK.file_of(page)
    HOOK.in_site(text_of(file), page, PAGES)
    for target, anchor in LINK.findall(text_of(file)):
        if ":" not in target:
            led_to = (PROJECT / file).parent / target if target else PROJECT / file
            if led_to.suffix == ".md":
                assert anchor in anchors(str(led_to.resolve().relative_to(PROJECT))), (target, anchor)


def test_links_lead_to_pages_of_the_site_or_become_text() -> None:
    text = (
        "[a](../SECURITY.md#x) [b](decisions/0001-layout-and-tools.md) [c](../Makefile) [d](https://e.org/)"
    )
    assert HOOK.in_site(text, "security.md", PAGES) == (
        "[a](repository/SECURITY.md#x) [b](decisions/0001-layout-and-tools.md) c [d](https://e.org/)"
    )
    readme = "[a](../../docs/nav2.md) `[b](no link)`"
    page = f"{HOOK.OTHERS}services/edge_agent/README.md"
    assert HOOK.in_site(readme, page, PAGES).startswith("[a](../../../nav2.md)")


def test_links_to_missing_files_are_errors() -> None:
    with pytest.raises(ValueError, match=r"docs/nav2\.md: the link to gone\.md leads to no file"):
        HOOK.in_site("see [this](gone.md)", "nav2.md", PAGES)


def test_first_steps_give_the_aggregator_its_order_service() -> None:
    """Without the address the panel shows no commands."""
    assert "\nnena-status-aggregator --order_service.url http://127.0.0.1:55200\n" in text_of(
        "docs/first-steps.md"
    )
