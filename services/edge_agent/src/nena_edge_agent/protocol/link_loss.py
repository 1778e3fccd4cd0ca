"""What the robot does while fleet control is out of its reach."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class LinkLossPolicy(StrEnum):
    """How a robot drives without its broker."""

    ASSERTIVE = "assertive"
    """It drives the base to its end, as the standard has it."""
    PREVENTIVE_AT_ONCE = "preventive_at_once"
    """It stops where it is, and waits."""
    PREVENTIVE_NEXT_NODE = "preventive_next_node"
    """It drives to the next node, and waits there."""


@dataclass(slots=True)
class LinkWatch:
    """Since when the link is lost, as a monotonic time in s; None: it stands.

    The robot may be without it for ``patience`` seconds.
    """

    policy: LinkLossPolicy
    patience: float
    lost_since: float | None = None

    @property
    def waits(self) -> bool:
        """Whether a loss may come to last too long."""
        return self.lost_since is not None and self.policy is not LinkLossPolicy.ASSERTIVE

    def out_of_reach(self, now: float) -> bool:
        """Tell whether the robot must not begin to drive to another node."""
        since = self.lost_since
        return self.waits and since is not None and now - since >= self.patience

    def must_stand(self, now: float) -> bool:
        """Tell whether the robot must stop where it is."""
        return self.policy is LinkLossPolicy.PREVENTIVE_AT_ONCE and self.out_of_reach(now)
