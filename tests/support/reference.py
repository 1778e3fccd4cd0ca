"""Reference material beside the project (official schemas, sample plant models), where there is any."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[2]


def reference_dir(*parts: str) -> Path:
    """Return a folder or file of the reference material; skip the test where it is not at hand.

    It is looked for in ``NENA_REFERENCE``, else in ``../shared/reference`` beside the project.
    """
    if not is_there(*parts):
        pytest.skip(f"reference material {'/'.join(parts)} is not there; NENA_REFERENCE names its folder")
    return _path(*parts)


def is_there(*parts: str) -> bool:
    """Return whether a folder or file of the reference material is at hand."""
    return _path(*parts).exists()


def _path(*parts: str) -> Path:
    root = Path(os.environ.get("NENA_REFERENCE", PROJECT.parent / "shared" / "reference"))
    return root.joinpath(*parts)
