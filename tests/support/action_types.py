"""Nav2's action types, which a machine without a compiler does not have."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

HERE = find_spec("nav2_msgs") is not None
WHY_NOT = "Nav2's action types are not made here: `make action-types` tells why"
needs_nav2_types = pytest.mark.skipif(
    not HERE or find_spec("nav2_msgs.msg") is None or find_spec("tf2_msgs") is None, reason=WHY_NOT
)
"""For tests that need messages and services of Nav2 and of transforms beside its actions."""
needs_action_types = pytest.mark.skipif(not HERE, reason=WHY_NOT)
needs_commander_types = pytest.mark.skipif(
    not HERE or find_spec("nav2_msgs.srv._manage_lifecycle_nodes") is None, reason=WHY_NOT
)
"""For tests that need all that nav2_simple_commander uses."""
