"""What a vehicle's energy lets it do, by the thresholds of the plant model, in openTCS's words."""

from __future__ import annotations

from dataclasses import dataclass

from nena_shared.plant.vehicle import EnergyThresholds


@dataclass(frozen=True, slots=True)
class Energy:
    """How much energy a vehicle has in percent, and whether it is being charged."""

    level: float
    charging: bool
    thresholds: EnergyThresholds

    @property
    def critical(self) -> bool:
        """Whether it may do nothing but recharge."""
        return self.level <= self.thresholds.critical

    @property
    def degraded(self) -> bool:
        """Whether it had better recharge when there is nothing else to do."""
        return self.level <= self.thresholds.good

    def recharged(self, *, fully: bool) -> bool:
        """Whether it has recharged enough to be called away, or ``fully``."""
        wanted = self.thresholds.fully_recharged if fully else self.thresholds.sufficiently_recharged
        return self.level >= wanted and not self.critical

    def restriction(self, *, fully: bool) -> str:
        """Say, as a predicate, why it takes no order but one to recharge; empty if it takes any.

        ``fully``: who charges goes on until it is fully recharged, not just sufficiently. The words stay the
        same while it discharges or recharges.
        """
        levels = self.thresholds
        if self.charging and not self.recharged(fully=fully):
            until = levels.fully_recharged if fully else max(levels.sufficiently_recharged, levels.critical)
            return f"recharges, and goes on until it has {until} % of its energy"
        if self.critical:
            return f"has to recharge first: its energy is not above {levels.critical} %, which is critical"
        return ""
