"""How much of a mission a robot is given at a time (VDA 5050 3.0 sections 6.1.2 and 6.6.3)."""

from __future__ import annotations

from dataclasses import dataclass

from nena_order_service.fleet import Mission
from nena_order_service.fleet.mission_update import released_to
from nena_order_service.kernel.mission_record import MissionRecord


@dataclass(frozen=True, slots=True)
class ReleasePolicy:
    """Releases ``ahead`` nodes before the robot, and shows the rest as horizon; 0: all of it at once.

    A robot that loses its link stops after so many nodes: *preventive* with few, *assertive* with all.
    """

    ahead: int = 0

    def first(self, record: MissionRecord) -> MissionRecord:
        """Give the record of a new mission with what is released at its start."""
        return self._released(record, 2 * self.ahead) if self.ahead else record

    def after_node(self, record: MissionRecord, sequence_id: int) -> MissionRecord | None:
        """Give what is released more when the robot has passed a node; None if nothing is."""
        return self._more(record, sequence_id + 2 * self.ahead)

    def when_wanted(self, record: MissionRecord) -> MissionRecord | None:
        """Give what is released more when the robot comes near the end of its base; None if nothing is."""
        return self._more(record, (record.released_to or 0) + 2 * self.ahead)

    def _more(self, record: MissionRecord, sequence_id: int) -> MissionRecord | None:
        last = record.mission.last_sequence_id
        if not self.ahead or record.released_to is None or min(sequence_id, last) <= record.released_to:
            return None
        more = self._released(record, sequence_id)
        return more.model_copy(update={"update_id": record.update_id + 1})

    @staticmethod
    def _released(record: MissionRecord, sequence_id: int) -> MissionRecord:
        end = min(sequence_id, record.mission.last_sequence_id)
        return record.model_copy(update={"released_to": end})


def as_released(record: MissionRecord) -> Mission:
    """Give the mission with its base as far as it is released."""
    return record.mission if record.released_to is None else released_to(record.mission, record.released_to)
