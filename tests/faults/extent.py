"""How much of the fault tests runs: a part of them with all other tests, all of them by ``make faults``."""

from __future__ import annotations

import os

import pytest

WHOLE = "NENA_FAULTS" in os.environ or "NENA_ORDER_KILLS" in os.environ
TIMES = int(os.environ.get("NENA_FAULTS", "1"))
"""How often each fault comes."""
ON_ROS = WHOLE
"""Whether a site has its two robots on ROS beside the eight loopback ones: they need a core of their own."""
ORDER_KILLS = int(os.environ.get("NENA_ORDER_KILLS", "5"))
"""How often the order service is killed at random moments."""
HOSTILE_MESSAGES = 10_000 if WHOLE else 1_000

only_in_whole = pytest.mark.skipif(not WHOLE, reason="takes about a minute: `make faults` runs it")
