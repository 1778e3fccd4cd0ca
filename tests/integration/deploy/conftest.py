from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from support.running_site import RunningSite


@pytest.fixture
def running(tmp_path: Path) -> Iterator[RunningSite]:
    made = RunningSite(tmp_path)
    yield made
    made.end()
