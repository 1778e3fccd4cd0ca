"""Positions of vehicles: as reported, as stored, and whether they count (openTCS: integration level)."""

from __future__ import annotations

from dataclasses import dataclass

from nena_order_service.engine.context import Context
from nena_order_service.fleet.position import NotLocatedError, Standing, TooFarError
from nena_order_service.fleet.robot import LinkStatus, RobotView
from nena_order_service.traffic.resources import Found
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.stops import SetBy
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

    def update_held(self, vehicle: FleetVehicle) -> bool:
        """Update what a vehicle without a route holds from its position; return whether that changed."""
        name = vehicle.name
        if not self._is_respected(vehicle):
            if name not in self._traffic:
                return False
            self._traffic.remove_vehicle(name)
            self.store_held(vehicle)
            log.info("vehicle no longer holds resources", vehicle=name)
            return True
        if self._traffic.route_of(name) or (view := self._view(vehicle)).link not in SPEAKS:
            return False
        previous = self._sightings.get(name)
        if view.state is None or (previous and previous.state is view.state) or self._is_doubted(name, view):
            return False
        moving = view.state.driving or bool(view.state.node_states or view.state.edge_states)
        # An unreadable state does not tell whether the robot has ended its order, so it may drive on at once.
        moving = moving or (view.link is LinkStatus.UNREADABLE and self._traffic.broke_off(name))
        sighting = self._sightings[name] = _Sighting(view.state, None, moving)
        standing = self._read_standing(vehicle, view, sighting)
        # The planner returns the same object for a position that has not changed.
        stayed = previous is not None and previous.standing is standing and previous.moving is moving
        box = box_of(vehicle, view.state)
        stayed = stayed and box.length_mm == box_of(vehicle, previous.state if previous else None).length_mm
        if standing is None or (stayed and name in self._traffic):
            return False
        changed = self._traffic.update_position(name, _to_found(vehicle, standing), box, moving=moving)
        if changed:
            self.store_held(vehicle)
        return changed

    def _read_standing(self, vehicle: FleetVehicle, view: RobotView, sighting: _Sighting) -> Standing | None:
        """Return where a vehicle stands; None: it keeps what it holds."""
        try:
            sighting.standing = self._planner.standing(vehicle, view)
        except TooFarError as error:
            # No position to drive from, but a vehicle that holds nothing yet may well be at its last node.
            if error.last and vehicle.name not in self._traffic:
                return Standing(error.last.name, on_point=True, pose=None)
        except NotLocatedError:
            pass
        return sighting.standing

    def store_held(self, vehicle: FleetVehicle) -> None:
        """Store the resources that a vehicle holds."""
        name = vehicle.name
        self._records.change(
            vehicle.key, held=self._traffic.held_by(name), beside=self._traffic.sets_beside(name)
        )

    def forget_sighting(self, vehicle: FleetVehicle, *, doubt: bool = False) -> None:
        """Read the position of a vehicle again; with ``doubt``, only from its next state."""
        self._sightings.pop(vehicle.name, None)
        if doubt:
            self._doubted[vehicle.name] = self._clock.monotonic()

    def why_unprotected(self, vehicle: FleetVehicle) -> Reason | None:
        """Return, as a predicate, that others are not kept away from a vehicle that reports; or None."""
        holds_nothing = self._is_respected(vehicle) and vehicle.name not in self._traffic
        is_unseen = holds_nothing and self._view(vehicle).link in SPEAKS
        return Reason(R.UNSEEN_BY_TRAFFIC) if is_unseen else None

    def is_located(self, vehicle: FleetVehicle) -> bool:
        """Return whether a vehicle has reported its position, and holds those resources."""
        sighting = self._sightings.get(vehicle.name)
        return sighting is not None and sighting.standing is not None and vehicle.name in self._traffic

    def obstacle_of(self, vehicle: FleetVehicle, *, working: bool = False) -> Reason | None:
        """Return, as a predicate, why a vehicle's level or position keeps it from taking orders; or None.

        ``working``: it already has an order, which it finishes at TO_BE_RESPECTED, too.
        """
        record = self._records.of(vehicle.key)
        level = record.integration_level
        # openTCS lets a host set TO_BE_RESPECTED during an order: the vehicle finishes it, and gets no other.
        may_finish = working and level is IntegrationLevel.TO_BE_RESPECTED
        if level is not IntegrationLevel.TO_BE_UTILIZED and not may_finish:
            if record.taken_out:
                return Reason.of(record.taken_out, record.coded_taken_out)
            return Reason(R.HAS_LEVEL, level=level.value)
        if not self._traffic.broke_off(vehicle.name):
            return None
        view = self._view(vehicle)
        if view.state and view.order_id is None and (view.state.node_states or view.state.edge_states):
            return Reason(R.UNKNOWN_ORDER, order=view.state.order_id)
        return Reason(R.OFF_ROUTE)

    def set_level(self, vehicle: FleetVehicle, level: IntegrationLevel, by: str) -> None:
        """Set the integration level of a vehicle for a host; orders that have failed no longer count."""
        used = level is IntegrationLevel.TO_BE_UTILIZED
        setter = None if used else SetBy(by=by, since=self._clock.now())
        changes = {"integration_level": level, "level_set": setter}
        self._records.change(vehicle.key, **changes, failed_at=(), taken_out="", coded_taken_out=None)
        self.forget_sighting(vehicle)
        self.update_held(vehicle)

    def _is_respected(self, vehicle: FleetVehicle) -> bool:
        """Return whether a vehicle's position counts, by its integration level and its map."""
        if not self._records.of(vehicle.key).integration_level.holds_resources:
            return False
        map_id, plant_maps = vehicle.profile.map_id, self._registry.map_ids
        if not vehicle.obstacle or map_id in plant_maps:
            return True
        # Until the plant's maps are known after a restart, a vehicle keeps what it holds.
        return vehicle.name in self._traffic and not (map_id and plant_maps)

    def _is_doubted(self, name: str, view: RobotView) -> bool:
        doubted = self._doubted.get(name)
        if doubted is None:
            return False
        if view.state_at is None or view.state_at <= doubted:
            return True
        del self._doubted[name]
        return False


def _to_found(vehicle: FleetVehicle, standing: Standing) -> Found:
    """Convert the position of a vehicle to traffic control's, mm in the plant frame."""
    pose = standing.pose
    if pose is None:
        return Found(standing.point, standing.on_point)
    position = vehicle.profile.on(pose.map_id).to_plant(MapPlace(pose.x, pose.y))
    place = (position.x_m * MM_PER_M, position.y_m * MM_PER_M)
    return Found(standing.point, standing.on_point, place, pose.map_id)


def box_of(vehicle: FleetVehicle, state: State | None = None) -> BoundingBox:
    """Return the size of a vehicle; the default size if it is not in the plant model.

    Its length depends on whether it reports loads; if it does not, it is the greater one.
    """
    model = vehicle.model
    if model is None:
        return BoundingBox()
    loads = state.loads if state else None
    cases = (False, True) if loads is None else (bool(loads),)
    length_mm = max(model.length_mm(loaded=case) for case in cases)
    box = model.bounding_box
    return box if box.length_mm == length_mm else box.model_copy(update={"length_mm": length_mm})
