"""Where the versions of VDA 5050 differ in behaviour: one table, a row per version."""

from __future__ import annotations

from dataclasses import dataclass

from nena_shared.vda5050.error import ErrorType


@dataclass(frozen=True, slots=True)
class Rules:
    """How one version decides where the others decide differently.

    ``wrong_stitching_node`` is the error of an update that does not begin at the decision point, by its
    neutral type: no version names it, and 2.x has one name for all errors of updates.
    """

    wrong_stitching_node: ErrorType


RULES: dict[str, Rules] = {
    "2.1.0": Rules(wrong_stitching_node=ErrorType.OUTDATED_ORDER_UPDATE),
}
