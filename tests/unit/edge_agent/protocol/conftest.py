from __future__ import annotations

import pytest

from support.robot_core import Bench, order


@pytest.fixture
def bench() -> Bench:
    """A robot on its way from n0 over n1 to n2, 10 m each."""
    bench = Bench()
    bench.send(order("n0", "n1", "n2"))
    return bench
