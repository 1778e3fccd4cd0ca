"""Reference material beside the project (official schemas, sample plant models), where there is any."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[2]


def reference_dir(*parts: str) -> Path:
    """Give a folder or file of the reference material; skip the test where it is not at hand.

    It is looked for in ``NENA_REFERENCE``, else in ``../shared/reference`` beside the project.
    """
    root = Path(os.environ.get("NENA_REFERENCE", PROJECT.parent / "shared" / "reference"))
    path = root.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"reference material {'/'.join(parts)} is not there; NENA_REFERENCE names its folder")
    return path
