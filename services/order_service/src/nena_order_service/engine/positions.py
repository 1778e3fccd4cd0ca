"""Positions of vehicles: as reported, as stored, and whether they count (openTCS: integration level)."""

from __future__ import annotations

from dataclasses import dataclass

from nena_order_service.engine.context import Context
from nena_order_service.fleet.position import NotLocatedError, Standing, TooFarError
from nena_order_service.fleet.robot import LinkStatus, RobotView
from nena_order_service.traffic.resources import Found
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.vehicle import IntegrationLevel
from nena_shared.log import get_logger
from nena_shared.plant import MapPlace
from nena_shared.plant.track import MM_PER_M, BoundingBox
from nena_shared.vda5050.state import State

R = ReasonCode

log = get_logger(__name__)


SPEAKS = (LinkStatus.ONLINE, LinkStatus.UNREADABLE)
"""Link states of robots that report."""


@dataclass(slots=True)
class _Sighting:
    """The last state of a vehicle whose position was read, and what it said; no position if it had none."""

    state: State
    standing: Standing | None
    moving: bool


class Positions:
    """Reports the positions of vehicles without a route to the traffic manager.

    The resources that a vehicle holds are stored, so that they are known after a restart before its robot
    reports. A vehicle that reports no state or no position keeps what it holds. Whatever else of a state is
    unreadable, its position counts.
    """

    def __init__(self, context: Context) -> None:
        self._traffic = context.traffic
        self._records = context.state.vehicles
        self._registry = context.registry
        self._planner = context.planner
        self._view = context.view
        self._clock = context.clock
        self._sightings: dict[str, _Sighting] = {}
        self._doubted: dict[str, float] = {}
        """Times at which positions became doubtful, monotonic seconds; only later states count."""

    def see(self, vehicle: FleetVehicle) -> bool:
        """Update what a vehicle without a route holds from its position; return whether that changed."""
        name = vehicle.name
        if not self._counts(vehicle):
            return self._take_out(vehicle)
        if self._traffic.route_of(name) or (view := self._view(vehicle)).link not in SPEAKS:
            return False
        known = self._sightings.get(name)
        if view.state is None or (known and known.state is view.state) or self._is_doubted(name, view):
            return False
        # an unreadable state does not tell whether the robot has ended its order, so it may drive on at once
        moving = _is_moving(view.state) or (
            view.link is LinkStatus.UNREADABLE and self._traffic.broke_off(name)
        )
        sighting = self._sightings[name] = _Sighting(view.state, None, moving)
        standing = self._standing(vehicle, view, sighting)
        stayed = known is not None and known.standing is standing and known.moving is sighting.moving
        if standing is None or (stayed and name in self._traffic):
            return False
        changed = self._traffic.seen(
            name, self._found(vehicle, standing), box_of(vehicle), moving=sighting.moving
        )
        if changed:
            self.note(vehicle)
        return changed

    def _standing(self, vehicle: FleetVehicle, view: RobotView, sighting: _Sighting) -> Standing | None:
        """Return where a vehicle stands; None: it keeps what it holds."""
        try:
            sighting.standing = self._planner.standing(vehicle, view)
        except TooFarError as error:
            # no position to drive from, but a vehicle that holds nothing yet may well be at its last node
            if error.last and vehicle.name not in self._traffic:
                return Standing(error.last.name, on_point=True, pose=None)
        except NotLocatedError:
            pass
        return sighting.standing

    def note(self, vehicle: FleetVehicle) -> None:
        """Store the resources that a vehicle holds."""
        name = vehicle.name
        self._records.change(vehicle.key, held=self._traffic.held(name), beside=self._traffic.beside(name))

    def forget_sighting(self, vehicle: FleetVehicle, *, doubt: bool = False) -> None:
        """Read the position of a vehicle again; with ``doubt``, only from its next state."""
        self._sightings.pop(vehicle.name, None)
        if doubt:
            self._doubted[vehicle.name] = self._clock.monotonic()

    def unseen(self, vehicle: FleetVehicle) -> Reason | None:
        """Return, as a predicate, that others are not kept away from a vehicle that reports; or None."""
        unseen = self._counts(vehicle) and vehicle.name not in self._traffic
        return Reason(R.UNSEEN_BY_TRAFFIC) if unseen and self._view(vehicle).link in SPEAKS else None

    def located(self, vehicle: FleetVehicle) -> bool:
        """Return whether a vehicle has reported its position, and holds those resources."""
        sighting = self._sightings.get(vehicle.name)
        return sighting is not None and sighting.standing is not None and vehicle.name in self._traffic

    def obstacle(self, vehicle: FleetVehicle, *, working: bool = False) -> Reason | None:
        """Return, as a predicate, why a vehicle's level or position keeps it from taking orders; or None.

        ``working``: it already has an order, which it finishes at TO_BE_RESPECTED, too.
        """
        record = self._records.of(vehicle.key)
        level = record.integration_level
        goes_on = working and level is IntegrationLevel.TO_BE_RESPECTED
        if level is not IntegrationLevel.TO_BE_UTILIZED and not goes_on:
            if record.taken_out:
                return Reason.of(record.taken_out, record.coded_taken_out)
            return Reason(R.HAS_LEVEL, level=level.value)
        if not self._traffic.broke_off(vehicle.name):
            return None
        view = self._view(vehicle)
        if view.state and view.order_id is None and (view.state.node_states or view.state.edge_states):
            return Reason(R.UNKNOWN_ORDER, order=view.state.order_id)
        return Reason(R.OFF_ROUTE)

    def is_taken_out(self, vehicle: FleetVehicle) -> bool:
        """Return whether a vehicle gets no orders because too many in a row have failed at it."""
        return bool(self._records.of(vehicle.key).taken_out)

    def level(self, vehicle: FleetVehicle) -> IntegrationLevel:
        """Return the integration level of a vehicle."""
        return self._records.of(vehicle.key).integration_level

    def set_level(self, vehicle: FleetVehicle, level: IntegrationLevel) -> None:
        """Set the integration level of a vehicle for a host; orders that have failed no longer count."""
        back = {"failed_at": (), "taken_out": "", "coded_taken_out": None}
        self._records.change(vehicle.key, integration_level=level, **back)
        self.forget_sighting(vehicle)
        self.see(vehicle)

    def _take_out(self, vehicle: FleetVehicle) -> bool:
        if vehicle.name not in self._traffic:
            return False
        self._traffic.remove(vehicle.name)
        self.note(vehicle)
        log.info("vehicle no longer holds resources", vehicle=vehicle.name)
        return True

    def _counts(self, vehicle: FleetVehicle) -> bool:
        """Return whether a vehicle's position counts, by its integration level and its map.

        Until the plant's maps are known after a restart, a vehicle keeps what it holds.
        """
        if not self.level(vehicle).holds_resources:
            return False
        map_id, plants = vehicle.profile.map_id, self._registry.map_ids
        if not vehicle.obstacle or map_id in plants:
            return True
        return vehicle.name in self._traffic and not (map_id and plants)

    def _is_doubted(self, name: str, view: RobotView) -> bool:
        doubted = self._doubted.get(name)
        if doubted is None:
            return False
        if view.state_at is None or view.state_at <= doubted:
            return True
        del self._doubted[name]
        return False

    def _found(self, vehicle: FleetVehicle, standing: Standing) -> Found:
        pose = standing.pose
        if pose is None:
            return Found(standing.point, standing.on_point)
        here = vehicle.profile.on(pose.map_id).to_plant(MapPlace(pose.x, pose.y))
        place = (here.x_m * MM_PER_M, here.y_m * MM_PER_M)
        return Found(standing.point, standing.on_point, place, pose.map_id)


def box_of(vehicle: FleetVehicle) -> BoundingBox:
    """Return the size of a vehicle; the default size if it is not in the plant model."""
    return vehicle.model.bounding_box if vehicle.model else BoundingBox()


def _is_moving(state: State) -> bool:
    return state.driving or bool(state.node_states or state.edge_states)
