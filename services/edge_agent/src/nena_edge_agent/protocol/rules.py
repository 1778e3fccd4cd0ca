"""Where the versions of VDA 5050 have a robot behave differently: one table, a row per version.

What both sides must know stands in the table of ``nena_shared``; here is what is the robot's alone. What the
versions only write differently is the codec's. Nothing in the core asks for the version itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from nena_shared.vda5050.error import ErrorType
from nena_shared.vda5050.rules import RULES as STANDARD
from nena_shared.vda5050.rules import Rules as StandardRules
from nena_shared.vda5050.state import OperatingMode


@dataclass(frozen=True, slots=True)
class Rules:
    """How one version decides where the others decide differently; ``standard`` is what both sides know."""

    standard: StandardRules
    wrong_stitching_node: ErrorType
    """The neutral error of an update that does not begin at the decision point; no version names it, and 2.x
    has one name for all errors of updates."""
    node_forgotten_in: frozenset[OperatingMode] = frozenset()
    """Modes that are entered with an empty lastNodeId."""
    node_left_in: frozenset[OperatingMode] = frozenset()
    """Modes in which lastNodeId becomes empty where the node cannot be the start of an order any more."""


RULES: Final[Mapping[str, Rules]] = MappingProxyType(
    {
        "2.0.0": Rules(STANDARD["2.0.0"], wrong_stitching_node=ErrorType.OUTDATED_ORDER_UPDATE),
        "2.1.0": Rules(STANDARD["2.1.0"], wrong_stitching_node=ErrorType.OUTDATED_ORDER_UPDATE),
        "3.0.0": Rules(
            STANDARD["3.0.0"],
            wrong_stitching_node=ErrorType.VALIDATION_FAILURE,
            node_forgotten_in=frozenset(
                {OperatingMode.STARTUP, OperatingMode.SERVICE, OperatingMode.TEACH_IN}
            ),
            node_left_in=frozenset({OperatingMode.MANUAL}),
        ),
    }
)
"""By version number."""
