from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _unmeasured(unmeasured: None) -> None:
    """Let commands and order services go at their own speed; unit tests measure their code."""
