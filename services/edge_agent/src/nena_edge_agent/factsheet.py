"""A robot's capabilities, from its settings and plug-ins, and its factsheet (section 7.10)."""

from __future__ import annotations

from typing import Any

from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.driver.port import DriveLimits
from nena_edge_agent.nav2.offers import NO_OFFERS, Nav2Offers
from nena_edge_agent.nav2.settings import GOAL_TOLERANCE
from nena_edge_agent.protocol.capabilities import Capabilities, supported
from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter, supported_actions
from nena_edge_agent.protocol.geometry import Footprint
from nena_edge_agent.protocol.instant_actions import MESSAGE_LIMIT
from nena_edge_agent.protocol.zone_sets import MAXIMUM_ZONES
from nena_edge_agent.settings import DescriptionSettings, EdgeAgentSettings
from nena_shared.vda5050 import factsheet
from nena_shared.vda5050.action import LOAD_HANDLING_DEVICE, STATION_ACTIONS, BlockingType
from nena_shared.vda5050.codec import MAXIMUM_PAYLOAD
from nena_shared.vda5050.rules import Rules
from nena_shared.vda5050.versions import RULES


def frame_of(settings: EdgeAgentSettings) -> str:
    """Return an identifier of the frame of all coordinates; it changes with the transforms."""
    if settings.driver != "nav2":
        return ""
    return "; ".join(f"{map_id}: {text}" for map_id, text in sorted(settings.map_transforms.items()))


def braking_distance(description: DescriptionSettings) -> float:
    """Return the braking distance in m, with half a second of reaction time."""
    speed, deceleration = description.maximum_speed, description.maximum_deceleration
    return speed * 0.5 + (speed * speed / (2 * deceleration) if deceleration else 0.0)


# Measured (Nav2 1.3.13): its default trees replan at 1 Hz, and at 0.33 Hz for several poses.
SEVERAL_SLOWER = 3.0
"""Ratio of Nav2's replanning periods for several poses and for one."""
ANSWER_TIME = 0.5
"""Assumed time for fleet control to extend a base on request, seconds."""


def make_capabilities(
    settings: EdgeAgentSettings, registry: ActionRegistry, offers: Nav2Offers = NO_OFFERS
) -> Capabilities:
    """Return the robot's capabilities, from its settings, plug-ins and Nav2's features."""
    drive, goals = settings.drive, settings.ros.goals
    by_nav2 = settings.driver == "nav2"
    # The robot must ask early enough that Nav2 has replanned for the new base before the old one ends.
    replanning = goals.replan_period * (SEVERAL_SLOWER if settings.drives_ahead else 1.0)
    return Capabilities(
        map_id=settings.map_id,
        map_version=settings.map_version,
        actions=supported_actions(registry.declarations, RULES[settings.version], settings.power_actions),
        maximum_speed=settings.description.maximum_speed,
        limits_speed=offers.limits_speed if by_nav2 else True,
        keeps_out=offers.keeps_out,
        follows_paths=offers.follows_paths,
        default_deviation_xy=drive.deviation_xy,
        default_deviation_theta=drive.deviation_theta,
        strategy=drive.strategy,
        pass_radius=drive.pass_radius,
        hand_over_distance=(goals.goal_tolerance or GOAL_TOLERANCE) if by_nav2 else 0.0,
        hand_over_time=goals.replan_period if by_nav2 else 0.0,
        drives_ahead=settings.drives_ahead,
        base_request_distance=drive.base_request_distance,
        base_request_time=replanning + ANSWER_TIME if by_nav2 else 0.0,
        external_goals=drive.external_goals,
        link_loss=drive.link_loss,
        link_loss_timeout=drive.link_loss_patience,
        drive_retries=drive.retries,
        retry_wait=drive.retry_wait,
        tolerated_parameters=frozenset(settings.tolerated_parameters),
        footprint=Footprint(settings.description.length, settings.description.width),
        braking_distance=braking_distance(settings.description),
        frame=frame_of(settings),
        rules=RULES[settings.version],
    )


def make_factsheet(
    header: dict[str, Any],
    settings: EdgeAgentSettings,
    capabilities: Capabilities,
    limits: DriveLimits | None = None,
) -> factsheet.Factsheet:
    """Return the factsheet (section 7.10); ``limits`` are navigation's, None: not reported."""
    offered = [action for action in capabilities.actions.values() if not action.unavailable]
    # A factsheet without load positions means a robot without a load handling device (7.10).
    load_positions = ("platform",) if any(action.load for action in offered) else ()
    return factsheet.Factsheet(
        **header,
        type_specification=_type_specification(settings, capabilities),
        physical_parameters=_physical_parameters(settings),
        protocol_limits=_protocol_limits(settings, capabilities.maximum_nodes),
        protocol_features=factsheet.ProtocolFeatures(
            # What is missing here counts as unsupported (7.10): fleet control must not send it.
            optional_parameters=supported(capabilities, limits),
            mobile_robot_actions=tuple(
                _action_description(declaration, capabilities.rules) for declaration in offered
            ),
        ),
        mobile_robot_geometry=_robot_geometry(settings, limits.contour if limits else ()),
        load_specification=factsheet.LoadSpecification(load_positions=load_positions),
    )


def _type_specification(
    settings: EdgeAgentSettings, capabilities: Capabilities
) -> factsheet.TypeSpecification:
    description = settings.description
    return factsheet.TypeSpecification(
        series_name=description.series_name,
        mobile_robot_kinematics=description.kinematics,
        mobile_robot_class=description.robot_class,
        maximum_load_mass=description.maximum_load_mass,
        localization_types=description.localization_types,
        # Nav2 plans freely; only a followed trajectory or corridor is a virtual line (7.10).
        navigation_types=(
            "FREELY_NAVIGATING",
            *(("VIRTUAL_LINE_GUIDED",) if capabilities.follows_paths else ()),
        ),
        supported_zones=tuple(sorted(capabilities.zones)),
    )


def _physical_parameters(settings: EdgeAgentSettings) -> factsheet.PhysicalParameters:
    description = settings.description
    return factsheet.PhysicalParameters(
        minimum_speed=0.0,
        maximum_speed=description.maximum_speed,
        minimum_angular_speed=0.0,
        maximum_angular_speed=description.maximum_angular_speed,
        maximum_acceleration=description.maximum_acceleration,
        maximum_deceleration=description.maximum_deceleration,
        minimum_height=description.height,
        maximum_height=description.height,
        width=description.width,
        length=description.length,
    )


def _protocol_limits(settings: EdgeAgentSettings, maximum_nodes: int) -> factsheet.ProtocolLimits:
    interval = settings.interval
    return factsheet.ProtocolLimits(
        maximum_string_lengths=factsheet.MaximumStringLengths(maximum_message_length=MAXIMUM_PAYLOAD),
        maximum_array_lengths=factsheet.MaximumArrayLengths(
            order_nodes=maximum_nodes,
            order_edges=maximum_nodes - 1,
            instant_actions=MESSAGE_LIMIT,
            zone_set_zones=MAXIMUM_ZONES,
        ),
        timing=factsheet.Timing(
            minimum_order_interval=0.0,
            minimum_state_interval=interval.state_minimum,
            default_state_interval=interval.state_maximum,
            visualization_interval=interval.visualization or None,
        ),
    )


def _action_description(declaration: ActionDeclaration, rules: Rules) -> factsheet.MobileRobotAction:
    return factsheet.MobileRobotAction(
        action_type=declaration.action_type,
        action_description=declaration.description or None,
        action_scopes=declaration.scopes,
        action_parameters=tuple(
            factsheet.ActionParameterDescription(
                key=_listed_key(declaration, parameter, rules),
                value_data_type=parameter.data_type,
                description=parameter.words or None,
                is_optional=not parameter.required,
            )
            for parameter in declaration.parameters
        ),
        action_result=declaration.result or None,
        # Instant actions are always NONE since 3.0 (7.4).
        blocking_types=(BlockingType.NONE,) if declaration.only_instant else declaration.blocking_types,
        pause_allowed=declaration.pause_allowed,
        cancel_allowed=declaration.cancel_allowed,
    )


def _listed_key(declaration: ActionDeclaration, parameter: Parameter, rules: Rules) -> str:
    """Return the parameter's key in the robot's version of VDA 5050."""
    # 3.0.1 renamed `lhd` of pick and drop to `loadHandlingDevice` (6.2.3); both are read.
    device = declaration.action_type in STATION_ACTIONS and parameter.key in LOAD_HANDLING_DEVICE
    return rules.load_handling_device_key if device else parameter.key


def _robot_geometry(
    settings: EdgeAgentSettings, contour: tuple[tuple[float, float], ...]
) -> factsheet.MobileRobotGeometry:
    """Return the robot's outline from navigation, else the rectangle from the settings."""
    x, y = settings.description.length / 2, settings.description.width / 2
    corners = contour or ((x, y), (-x, y), (-x, -y), (x, -y))
    vertices = tuple(factsheet.Envelope2dPoint(x=x, y=y) for x, y in corners)
    return factsheet.MobileRobotGeometry(
        envelopes2d=(factsheet.Envelope2d(envelope2d_id="footprint", vertices=vertices),)
    )
