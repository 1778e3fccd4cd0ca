"""Size of the largest tests; ``make soak-cores`` and ``make fuzz`` use more."""

from __future__ import annotations

import os

EXAMPLES = int(os.environ.get("NENA_EXAMPLES", "200"))
"""Random histories of the robot's core, over all versions; machines of one part take a share of it."""

MESSAGES = int(os.environ.get("NENA_MESSAGES", "10"))
"""Random messages of each kind in each version."""

PLANTS = int(os.environ.get("NENA_PLANTS", "6"))
"""Random plants on which a fleet is simulated."""

ENGINE_PLANTS = int(os.environ.get("NENA_ENGINE_PLANTS", "4"))
"""Random plants on which a fleet is simulated under the real engine."""

KILLS = int(os.environ.get("NENA_KILLS", "3"))
"""How often the process of an edge agent is killed while it drives."""

DAMAGED_FILES = int(os.environ.get("NENA_FUZZ_FILES", "100"))
"""Files that went wrong, of each kind; ``make fuzz`` has more."""

FUZZ_SEED = os.environ.get("NENA_FUZZ_SEED", "")
"""Chooses how messages and files go wrong; as it is, the same in each run."""

RESTARTS = int(os.environ.get("NENA_RESTARTS", "8"))
"""Moments of each order at which the edge agent dies."""
