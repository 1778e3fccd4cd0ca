"""What the zones of the robot's map mean for its driving (section 6.4)."""

from __future__ import annotations

from datetime import datetime
from itertools import islice

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.protocol.events import LimitSpeed
from nena_edge_agent.protocol.geometry import distance
from nena_edge_agent.protocol.parts import RobotParts
from nena_edge_agent.protocol.zone_sets import LOST, EnabledZone, ZoneKey, first_closed, zones_in
from nena_shared.vda5050.error import ErrorEntry, ErrorType, error
from nena_shared.vda5050.order import NodePosition
from nena_shared.vda5050.request import RequestStatus
from nena_shared.vda5050.responses import Responses
from nena_shared.vda5050.zone_set import ZoneReleaseLossBehavior, ZoneType

WAYS_AHEAD = 2
"""Edges of the base ahead whose zones the robot asks for: the one that it drives on and the next one."""


class ZoneGuard:
    """Says where the robot may drive and how fast, and asks for the zones that need a release."""

    def __init__(self, parts: RobotParts) -> None:
        self._parts = parts
        self._concerned = False

    def barred(self, start: Pose | NodePosition, end: NodePosition) -> EnabledZone | None:
        """Give the first zone on the straight way to ``end`` that the robot must not drive in now."""
        zones = self._on_way(start, end)
        return first_closed(zones) or next((each for each in zones if not self._open(each)), None)

    @property
    def must_stand(self) -> bool:
        """Whether the robot must not go on from where it is."""
        parts = self._parts
        pose, node = parts.senses.trusted_pose, parts.progress.next_node
        if not parts.zone_sets.enabled or pose is None:
            return False
        if any(each.zone.zone_type is ZoneType.BLOCKED for each in self._inside()):
            return True
        return bool(node and node.node_position and self.barred(pose, node.node_position))

    def answered(self, message: Responses, utc: datetime) -> None:
        """Take in fleet control's answers, which came at ``utc``; a grant whose time is over is none."""
        parts = self._parts
        parts.utc = (utc, parts.now)
        inside = self._perhaps_inside()
        for response in message.responses:
            if response.lease_expiry is None or response.lease_expiry > utc:
                parts.zone_access.answer(response, inside, parts.now)

    def expire(self) -> None:
        """End the grants whose time is over."""
        parts = self._parts
        now = parts.utc_now
        if now is not None and parts.zone_access.waits:
            parts.zone_access.expire(now, self._perhaps_inside())

    def advance(self) -> None:
        """Ask for what is wanted, take back what is not, and show what is wrong."""
        parts = self._parts
        concerned = bool(parts.zone_sets.enabled or parts.zone_access.requests)
        if not concerned and not self._concerned:
            return  # but once more behind the last zone, to take back what it meant
        self._concerned = concerned
        inside = self._inside()
        self._keep_requests(inside)
        self._limit_speed()
        parts.errors.condition(ErrorType.BLOCKED_ZONE_VIOLATION, _violation(inside))
        parts.errors.condition(ErrorType.RELEASE_LOST, self._loss(inside))
        parts.errors.condition(ErrorType.NODE_UNREACHABLE, self._closed_way())

    def _keep_requests(self, inside: list[EnabledZone]) -> None:
        parts = self._parts
        if not parts.operating_mode.fleet_controls or parts.progress.cleared:
            parts.zone_access.keep_only(frozenset())
            return
        if parts.senses.trusted_pose is None:
            return  # it may be in any of them
        wanted, kept = self._ahead(), self._keys(inside)
        parts.zone_access.keep_only(self._keys(wanted) | kept, kept)
        if not parts.clearing:
            parts.zone_access.want(wanted, parts.now)

    def _ahead(self) -> list[EnabledZone]:
        """Give the RELEASE zones on the next edges of the base."""
        parts = self._parts
        start: Pose | NodePosition | None = parts.senses.trusted_pose
        found: list[EnabledZone] = []
        for node in islice(parts.progress.nodes, WAYS_AHEAD):
            if not node.released or start is None or node.node_position is None:
                break
            found += _of_type(self._on_way(start, node.node_position), ZoneType.RELEASE)
            start = node.node_position
        return found

    def _limit_speed(self) -> None:
        """Be as slow as the slowest zone wants it, before its border is reached."""
        parts = self._parts
        pose, node = parts.senses.trusted_pose, parts.progress.next_node
        if pose is None:
            return
        place = node.node_position if node else None
        zones = self._on_way(pose, self._braking_point(pose, place)) if place else self._inside()
        limits = [each.zone.maximum_speed or 0.0 for each in _of_type(zones, ZoneType.SPEED_LIMIT)]
        limit = min(limits, default=None)
        if limit != parts.speed_limit:
            parts.speed_limit = limit
            parts.effects.append(LimitSpeed(limit))

    def _braking_point(self, pose: Pose, end: NodePosition) -> NodePosition:
        """Give where the robot is at the earliest when it has slowed down on its way to ``end``."""
        way = distance(pose, end)
        share = min(1.0, self._parts.capabilities.braking_distance / way) if way else 1.0
        return NodePosition(
            x=pose.x + share * (end.x - pose.x), y=pose.y + share * (end.y - pose.y), map_id=end.map_id
        )

    def _on_way(self, start: Pose | NodePosition, end: NodePosition) -> list[EnabledZone]:
        parts = self._parts
        if not parts.zone_sets.enabled:
            return []
        ground = parts.capabilities.footprint.way(start, end)
        return zones_in(ground, end.map_id, parts.zone_sets.enabled)

    def _inside(self) -> list[EnabledZone]:
        parts = self._parts
        pose = parts.senses.trusted_pose
        if not parts.zone_sets.enabled or pose is None:
            return []
        return zones_in(parts.capabilities.footprint.stand(pose), pose.map_id, parts.zone_sets.enabled)

    def _perhaps_inside(self) -> frozenset[ZoneKey]:
        """Give the RELEASE zones that the robot is in; a lost one may be in any that it has asked for."""
        parts = self._parts
        if parts.senses.trusted_pose is None:
            return frozenset(each.key for each in parts.zone_access.requests)
        return self._keys(self._inside())

    def _open(self, zone: EnabledZone) -> bool:
        """Tell whether the robot may be in ``zone`` and drive in it."""
        if zone.zone.zone_type is not ZoneType.RELEASE:
            return True
        status = self._parts.zone_access.status(zone.key)
        if status in LOST:
            return self._goes_on(zone) and zone.key in self._keys(self._inside())
        return status is RequestStatus.GRANTED

    def _goes_on(self, zone: EnabledZone) -> bool:
        """Tell whether the robot drives on in a zone that its release for was lost."""
        match zone.zone.release_loss_behavior:
            case ZoneReleaseLossBehavior.CONTINUE:
                return True
            case ZoneReleaseLossBehavior.EVACUATE:
                return self._leads_out(zone)
            case _:
                return False

    def _leads_out(self, zone: EnabledZone) -> bool:
        """Tell whether the base ends outside of ``zone``: then going on is the way out."""
        base = [node.node_position for node in self._parts.progress.nodes if node.released]
        end = base[-1] if base else None
        if end is None:
            return False
        pose = Pose(end.x, end.y, end.theta or 0.0, end.map_id)
        return not zones_in(self._parts.capabilities.footprint.stand(pose), end.map_id, (zone,))

    def _loss(self, inside: list[EnabledZone]) -> ErrorEntry | None:
        lost = (each for each in inside if self._parts.zone_access.status(each.key) in LOST)
        zone = next((each for each in lost if not self._goes_on(each)), None)
        if zone is None:
            return None
        return error(
            ErrorType.RELEASE_LOST,
            f"the release for zone '{zone.zone.zone_id}' was lost while the robot was in it; it stands",
            hint="grant the request again, or cancel the order and move the robot out by hand",
            zone_id=zone.zone.zone_id,
        )

    def _closed_way(self) -> ErrorEntry | None:
        """Show that a zone was closed on the way after the order was taken."""
        parts = self._parts
        pose, node = parts.senses.trusted_pose, parts.progress.next_node
        place = node.node_position if node else None
        zone = first_closed(self._on_way(pose, place)) if pose and place else None
        if zone is None or node is None:
            return None
        return error(
            ErrorType.NODE_UNREACHABLE,
            f"the way to node '{node.node_id}' leads through zone '{zone.zone.zone_id}', "
            f"which is {zone.zone.zone_type}",
            hint="enable another zone set, or cancel the order",
            node_id=node.node_id,
            order_id=parts.progress.order_id,
            zone_id=zone.zone.zone_id,
        )

    @staticmethod
    def _keys(zones: list[EnabledZone]) -> frozenset[ZoneKey]:
        return frozenset(each.key for each in zones if each.zone.zone_type is ZoneType.RELEASE)


def _of_type(zones: list[EnabledZone], wanted: ZoneType) -> list[EnabledZone]:
    return [each for each in zones if each.zone.zone_type is wanted]


def _violation(inside: list[EnabledZone]) -> ErrorEntry | None:
    zone = next(iter(_of_type(inside, ZoneType.BLOCKED)), None)
    if zone is None:
        return None
    return error(
        ErrorType.BLOCKED_ZONE_VIOLATION,
        f"the robot stands in zone '{zone.zone.zone_id}', which is BLOCKED, and does not drive",
        hint="move the robot out by hand, or enable another zone set",
        zone_id=zone.zone.zone_id,
    )
