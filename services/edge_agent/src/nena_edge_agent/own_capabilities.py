"""What the settings say that a robot can do, as the protocol core takes it."""

from __future__ import annotations

from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.kept_frame import frame_of
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.ground import Footprint
from nena_edge_agent.protocol.predefined import spoken
from nena_edge_agent.protocol.rules import RULES
from nena_edge_agent.settings import DescriptionSettings, EdgeAgentSettings


def braking_distance(description: DescriptionSettings) -> float:
    """Give the way in m in which the robot stops, with half a second to begin to."""
    speed, deceleration = description.maximum_speed, description.maximum_deceleration
    return speed * 0.5 + (speed * speed / (2 * deceleration) if deceleration else 0.0)


def make_capabilities(settings: EdgeAgentSettings, registry: ActionRegistry) -> Capabilities:
    """Give the core what it needs to know of the settings."""
    drive = settings.drive
    return Capabilities(
        map_id=settings.map_id,
        map_version=settings.map_version,
        actions=spoken(registry.declarations, RULES[settings.version].standard),
        maximum_speed=settings.description.maximum_speed,
        limits_speed=settings.driver == "loopback",  # Nav2 takes no limit by its topics
        default_deviation_xy=drive.deviation_xy,
        default_deviation_theta=drive.deviation_theta,
        strategy=drive.strategy,
        pass_radius=drive.pass_radius,
        drives_ahead=settings.drives_ahead,
        base_request_distance=drive.base_request_distance,
        external_goals=drive.external_goals,
        link_loss=drive.link_loss,
        link_loss_patience=drive.link_loss_patience,
        drive_retries=drive.retries,
        retry_wait=drive.retry_wait,
        tolerated_parameters=frozenset(settings.tolerated_parameters),
        footprint=Footprint(settings.description.length, settings.description.width),
        braking_distance=braking_distance(settings.description),
        frame=frame_of(settings),
        rules=RULES[settings.version],
    )
