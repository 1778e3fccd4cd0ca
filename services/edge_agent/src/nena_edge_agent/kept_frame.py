"""The frame of what the journal keeps: coordinates mean other places once the transforms are others."""

from __future__ import annotations

from nena_edge_agent.protocol.memory import Memory
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.program import StartError


def frame_of(settings: EdgeAgentSettings) -> str:
    """Name the frame of all coordinates; two names differ where the transforms do."""
    if settings.driver != "nav2":
        return ""
    return "; ".join(f"{map_id}: {text}" for map_id, text in sorted(settings.map_transforms.items()))


def check_frame(memory: Memory | None, frame: str) -> None:
    """Make sure that what was being driven means the same places still.

    Raises:
        StartError: the robot would drive elsewhere.

    """
    if memory is None or memory.frame == frame or not (memory.progress.nodes or memory.zone_sets):
        return
    order = f"order '{memory.progress.order_id}' is under way"
    message = (
        f"{order if memory.progress.nodes else 'zone sets are kept'} in another frame: map_transforms was "
        f"'{memory.frame}' and is '{frame}'; put it back, have the order end or the zone sets deleted, then "
        "change it"
    )
    raise StartError(message)
