"""Hook of MkDocs: the pages of the site beyond ``docs``, and links to files of the repository.

Pages link to each other and to other files by relative paths, as they are read in the repository. In the
site, a link to a file that has a page leads to this page; a link to another file becomes plain text.
"""

# ruff: noqa: INP001 - MkDocs loads it by its path

from __future__ import annotations

import posixpath
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

REPOSITORY: Final = Path(__file__).parents[2]
DOCS: Final = "docs"
OTHERS: Final = "repository/"
"""Folder of the site with pages whose files are not in ``docs``."""
DECISIONS: Final = "decisions/"
"""Entry of the navigation that stands for all files of this folder."""

_LINK: Final = re.compile(r"(?<!\!)\[(?P<text>[^\[\]]*)\]\((?P<target>[^()\s#]*)(?P<anchor>#[^()\s]*)?\)")
_CODE: Final = re.compile(r"(```.*?```|~~~.*?~~~)", re.DOTALL)
_EXTERNAL: Final = re.compile(r"[a-z]+:|/")


def pages_of(nav: Iterable[Any]) -> list[str]:
    """Return the pages of the navigation, in their order, without those of the decisions."""
    found: list[str] = []
    for entry in nav:
        for content in entry.values():
            found.extend(pages_of(content) if isinstance(content, list) else [content])
    return [each for each in found if each != DECISIONS]


def decisions() -> list[str]:
    """Return the pages of all decisions, by number."""
    folder = REPOSITORY / DOCS / DECISIONS
    return sorted(f"{DECISIONS}{each.name}" for each in folder.glob("*.md"))


def file_of(page: str) -> str:
    """Return the path of a page's file in the repository."""
    return page.removeprefix(OTHERS) if page.startswith(OTHERS) else f"{DOCS}/{page}"


def in_site(text: str, page: str, pages: Iterable[str]) -> str:
    """Return the Markdown of a page with the links that its place in the site needs.

    Raises:
        ValueError: a link leads to a file that does not exist.
    """
    by_file = {file_of(each): each for each in pages}
    here = file_of(page)

    def link(match: re.Match[str]) -> str:
        target, anchor = match["target"], match["anchor"] or ""
        if not target or _EXTERNAL.match(target):
            return match[0]
        file = posixpath.normpath(posixpath.join(posixpath.dirname(here), target))
        if not (REPOSITORY / file).exists():
            message = f"{here}: the link to {target} leads to no file"
            raise ValueError(message)
        if file in by_file:
            return f"[{match['text']}]({posixpath.relpath(by_file[file], posixpath.dirname(page))}{anchor})"
        return match["text"]

    parts = _CODE.split(text)
    return "".join(part if index % 2 else _LINK.sub(link, part) for index, part in enumerate(parts))


def on_config(config: Any) -> None:  # noqa: ANN401 - MkDocs is not installed where types are checked
    """Put all decisions into the navigation."""

    def filled(nav: list[Any]) -> list[Any]:
        return [
            {
                title: [*decisions()]
                if content == DECISIONS
                else filled(content)
                if isinstance(content, list)
                else content
                for title, content in entry.items()
            }
            for entry in nav
        ]

    config.nav = filled(config.nav)


def on_files(files: Any, config: Any) -> None:  # noqa: ANN401 - see on_config
    """Add the pages whose files are not in ``docs``."""
    from mkdocs.structure.files import File  # noqa: PLC0415 - only where the site is built

    for page in pages_of(_plain(config.nav)):
        if page.startswith(OTHERS):
            path = str(REPOSITORY / file_of(page))
            files.append(File.generated(config, page, abs_src_path=path))


def on_page_markdown(markdown: str, page: Any, config: Any, **_: Any) -> str:  # noqa: ANN401 - see on_config
    """Return the Markdown of a page with the links that it has in the site."""
    return in_site(markdown, page.file.src_uri, [*pages_of(_plain(config.nav)), *decisions()])


def _plain(nav: list[Any]) -> list[Any]:
    """Return the navigation without the decisions, which have no titles of their own."""
    return [
        {title: _plain(content) if isinstance(content, list) else content for title, content in entry.items()}
        for entry in nav
        if isinstance(entry, dict)
    ]
