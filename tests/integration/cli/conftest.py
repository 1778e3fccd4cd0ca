from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _unmeasured(unmeasured: None) -> None:
    """Disable coverage in commands and order services; unit tests measure their code."""
