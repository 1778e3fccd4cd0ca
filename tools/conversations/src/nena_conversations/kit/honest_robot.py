"""A robot that keeps to VDA 5050 and can do little: it drives a node per step, cancels, fails on request.

It is no copy of the edge agent: it is written from the rules alone, so that fleet control can be tried
against something that it does not share a line with. It knows no clock and no broker.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

from nena_shared.vda5050.action import Action, ActionState, ActionStatus, InstantActions
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.error import ErrorEntry, ErrorType, error
from nena_shared.vda5050.factsheet import (
    Factsheet,
    LoadSpecification,
    MaximumArrayLengths,
    MaximumStringLengths,
    MobileRobotAction,
    MobileRobotGeometry,
    PhysicalParameters,
    ProtocolFeatures,
    ProtocolLimits,
    Timing,
    TypeSpecification,
)
from nena_shared.vda5050.order import Edge, Node, Order
from nena_shared.vda5050.request import ZoneRequest
from nena_shared.vda5050.state import (
    EdgeState,
    EmergencyStop,
    MobileRobotPosition,
    NodeState,
    OperatingMode,
    PowerSupply,
    SafetyState,
    State,
)
from nena_shared.vda5050.topics import RobotKey

ROBOT = RobotKey("Honest", "robot-1")
MAP = "hall"
START = datetime(2026, 1, 1, tzinfo=UTC)
NO_LIMITS = ProtocolLimits(
    maximum_string_lengths=MaximumStringLengths(),
    maximum_array_lengths=MaximumArrayLengths(),
    timing=Timing(minimum_order_interval=0.0, minimum_state_interval=0.1),
)


@dataclass
class HonestRobot:
    """The robot's whole memory; :meth:`restart` clears what does not survive a restart."""

    key: RobotKey = ROBOT
    order_id: str = ""
    last_node_id: str = ""
    last_sequence_id: int = 0
    update_id: int = 0
    cleared: bool = False
    refuses_updates: bool = False
    nodes: list[Node] = field(default_factory=list)
    edges: list[Edge] = field(default_factory=list)
    actions: list[Action] = field(default_factory=list)
    statuses: dict[str, ActionStatus] = field(default_factory=dict)
    instants: dict[str, tuple[Action, ActionStatus]] = field(default_factory=dict)
    errors: list[ErrorEntry] = field(default_factory=list)
    mode: OperatingMode = OperatingMode.AUTOMATIC
    paused: bool = False
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    map_id: str = MAP
    localized: bool = True
    has_pose: bool = True
    """False as between its start and the first pose of its localisation."""
    charge: float = 80.0
    charging: bool = False
    header_id: int = 0
    version: str = "2.1.0"
    zone_requests: tuple[ZoneRequest, ...] = ()
    reports_instants_apart: bool = False
    """True as in 3.0; False as in 2.x, among the order's actions."""
    lists: tuple[MobileRobotAction, ...] = ()
    """The actions in its factsheet; none: it leaves them out."""
    limits: ProtocolLimits = NO_LIMITS
    fulfils: tuple[str, ...] = ()
    """Further instant actions that end FINISHED; all others fail."""
    emergency_stop: EmergencyStop = EmergencyStop.NONE
    actions_fail: bool = False
    unreachable: set[str] = field(default_factory=set)
    names_refusals: bool = True
    executed: list[str] = field(default_factory=list)
    """Ids of actions in the order of their beginning, over the robot's whole life."""
    accepted: list[str] = field(default_factory=list)
    """Ids of orders in the order of their acceptance, over the robot's whole life."""

    @property
    def idle(self) -> bool:
        """Return whether it has nothing left to do."""
        return not self.nodes and not self.edges and all(each.ended for each in self.statuses.values())

    def take_order(self, order: Order) -> None:
        """Take an order or an update, or refuse it."""
        if order.order_id == self.order_id:
            self._take_update(order)
        elif not self.mode.takes_orders:
            self.refuse(order, ErrorType.MOBILE_ROBOT_NOT_AVAILABLE)
        elif not self.idle:
            self.refuse(order, ErrorType.OTHER_ORDER_ACTIVE)
        elif not self._stands_at(order.nodes[0]):
            self.refuse(order, ErrorType.START_NODE_OUT_OF_RANGE)
        else:
            self._accept(order)

    def _take_update(self, order: Order) -> None:
        """Put an update behind the base; it must begin where the base ends."""
        if order.order_update_id <= self.update_id:
            return
        base = [node for node in self.nodes if node.released]
        end = (base[-1].node_id, base[-1].sequence_id) if base else (self.last_node_id, self.last_sequence_id)
        first = order.nodes[0]
        if self.cleared or (first.node_id, first.sequence_id) != end or self.refuses_updates:
            self.refuse(order, ErrorType.OUTDATED_ORDER_UPDATE)
            return
        horizon = {action.action_id for node in self.nodes if not node.released for action in node.actions}
        self.actions = [each for each in self.actions if each.action_id not in horizon]
        self.nodes = [*base, *order.nodes[1:]]
        self.edges = [*self.edges[: len(base)], *order.edges]
        self.update_id = order.order_update_id
        new = [action for node in order.nodes[1:] for action in node.actions]
        self.actions += new
        self.statuses = {key: status for key, status in self.statuses.items() if key not in horizon}
        self.statuses |= {action.action_id: ActionStatus.WAITING for action in new}

    def take_instant_actions(self, message: InstantActions) -> None:
        """Run the instant actions that it does not have yet."""
        for action in message.actions:
            if action.action_id not in self.instants:
                self.instants[action.action_id] = (action, self._run_instant(action))

    def step(self) -> None:
        """Take the next step: drive to a node, start an action, or end it."""
        if self.paused:
            return
        running = next((each for each in self.actions if not self.statuses[each.action_id].ended), None)
        if self.nodes:
            if self.nodes[0].released:
                self._drive(self.nodes[0])
        elif running and self.statuses[running.action_id] is ActionStatus.WAITING:
            self.statuses[running.action_id] = ActionStatus.RUNNING
            self.executed.append(running.action_id)
        elif running:
            self._end(running)

    def set_mode(self, mode: OperatingMode) -> None:
        """Switch the mode; one in which it takes no orders ends its order."""
        self.mode = mode
        if not mode.takes_orders:
            self._clear()

    def restart(self, *, journal: bool) -> None:
        """Restart; without a journal the order is lost."""
        self.header_id = 0
        self.instants.clear()
        if not journal:
            self._clear()
            self.order_id, self.last_node_id, self.last_sequence_id = "", "", 0
            self.statuses.clear()
            self.actions.clear()

    def connection(self, state: ConnectionState, seconds: float = 0.0) -> Connection:
        """Return a connection message."""
        return Connection(
            header_id=0,
            timestamp=START + timedelta(seconds=seconds),
            version=self.version,
            manufacturer=self.key.manufacturer,
            serial_number=self.key.serial_number,
            connection_state=state,
        )

    def factsheet(self) -> Factsheet:
        """Return the factsheet of a small carrier."""
        return Factsheet(
            header_id=1,
            timestamp=START,
            version=self.version,
            manufacturer=self.key.manufacturer,
            serial_number=self.key.serial_number,
            type_specification=TypeSpecification(
                series_name="Carrier 100",
                mobile_robot_kinematics="DIFFERENTIAL",
                mobile_robot_class="CARRIER",
                maximum_load_mass=100.0,
                localization_types=("NATURAL",),
                navigation_types=("FREELY_NAVIGATING",),
            ),
            physical_parameters=PhysicalParameters(
                minimum_speed=0.0,
                maximum_speed=1.2,
                maximum_acceleration=1.0,
                maximum_deceleration=1.0,
                minimum_height=0.4,
                maximum_height=0.4,
                width=0.7,
                length=1.1,
            ),
            protocol_limits=self.limits,
            protocol_features=ProtocolFeatures(optional_parameters=(), mobile_robot_actions=self.lists),
            mobile_robot_geometry=MobileRobotGeometry(),
            load_specification=LoadSpecification(),
        )

    def state(self, seconds: float = 0.0) -> State:
        """Return a complete new state."""
        self.header_id += 1
        own = [_action_state(each, self.statuses[each.action_id]) for each in self.actions]
        instants = [_action_state(*each) for each in self.instants.values()]
        x, y, theta = self.position
        return State(
            header_id=self.header_id,
            timestamp=START + timedelta(seconds=seconds),
            version=self.version,
            manufacturer=self.key.manufacturer,
            serial_number=self.key.serial_number,
            order_id=self.order_id,
            order_update_id=self.update_id,
            last_node_id=self.last_node_id,
            last_node_sequence_id=self.last_sequence_id,
            node_states=tuple(
                NodeState(node_id=each.node_id, sequence_id=each.sequence_id, released=bool(each.released))
                for each in self.nodes
            ),
            edge_states=tuple(
                EdgeState(edge_id=each.edge_id, sequence_id=each.sequence_id, released=bool(each.released))
                for each in self.edges
            ),
            driving=any(each.released for each in self.nodes) and not self.paused,
            new_base_request=bool(self.nodes) and not self.nodes[-1].released and len(self._base) <= 1,
            paused=self.paused,
            action_states=tuple(own if self.reports_instants_apart else own + instants),
            instant_action_states=tuple(instants if self.reports_instants_apart else ()),
            mobile_robot_position=MobileRobotPosition(
                x=x, y=y, theta=theta, map_id=self.map_id, localized=self.localized
            )
            if self.has_pose
            else None,
            power_supply=PowerSupply(state_of_charge=self.charge, charging=self.charging),
            zone_requests=self.zone_requests,
            operating_mode=self.mode,
            errors=tuple(self.errors),
            safety_state=SafetyState(active_emergency_stop=self.emergency_stop, field_violation=False),
        )

    def _accept(self, order: Order) -> None:
        first = order.nodes[0]
        self.order_id, self.last_node_id, self.last_sequence_id = order.order_id, first.node_id, 0
        self.update_id, self.cleared = 0, False
        self.nodes, self.edges = list(order.nodes[1:]), list(order.edges)
        self.actions = [action for node in order.nodes for action in node.actions]
        self.statuses = {action.action_id: ActionStatus.WAITING for action in self.actions}
        self.errors.clear()
        self.accepted.append(order.order_id)

    def refuse(self, order: Order, kind: ErrorType) -> None:
        """Report that it does not take an order."""
        named = self.names_refusals
        entry = error(
            kind,
            "no",
            order_id=order.order_id if named else None,
            order_update_id=order.order_update_id if named else None,
        )
        if entry not in self.errors:
            self.errors.append(entry)

    @property
    def _base(self) -> list[Node]:
        return [node for node in self.nodes if node.released]

    def _stands_at(self, node: Node) -> bool:
        place = node.node_position
        if place is None or place.allowed_deviation_xy is None:
            return True
        if not self.has_pose:
            return False
        x, y, _ = self.position
        return (place.x - x) ** 2 + (place.y - y) ** 2 <= place.allowed_deviation_xy.a**2 + 1e-9

    def _drive(self, node: Node) -> None:
        if node.node_id in self.unreachable:
            entry = error(ErrorType.NODE_UNREACHABLE, "no way", node_id=node.node_id, order_id=self.order_id)
            if entry not in self.errors:
                self.errors.append(entry)
            return
        self.nodes.pop(0)
        self.edges.pop(0)
        self.last_node_id, self.last_sequence_id = node.node_id, node.sequence_id
        place = node.node_position
        if place:
            self.position = (place.x, place.y, self.position[2] if place.theta is None else place.theta)

    def _end(self, action: Action) -> None:
        self.statuses[action.action_id] = ActionStatus.FAILED if self.actions_fail else ActionStatus.FINISHED
        if self.actions_fail:
            self.errors.append(error(ErrorType.ACTION_FAILED, "dropped it", action_id=action.action_id))

    def _run_instant(self, action: Action) -> ActionStatus:
        if action.action_type == "cancelOrder":
            if self.idle:
                self.errors.append(
                    error(ErrorType.NO_ORDER_TO_CANCEL, "nothing to do", action_id=action.action_id)
                )
                return ActionStatus.FAILED
            self._clear()
        elif action.action_type in ("startPause", "stopPause"):
            self.paused = action.action_type == "startPause"
        elif action.action_type == "clearInstantActions":
            self.instants.clear()
        elif action.action_type in self.fulfils:
            return ActionStatus.FINISHED
        else:
            return ActionStatus.FAILED
        return ActionStatus.FINISHED

    def _clear(self) -> None:
        self.cleared = True
        self.nodes.clear()
        self.edges.clear()
        for action_id, status in self.statuses.items():
            if not status.ended:
                self.statuses[action_id] = ActionStatus.FAILED


def _action_state(action: Action, status: ActionStatus) -> ActionState:
    return ActionState(action_id=action.action_id, action_type=action.action_type, action_status=status)


def words(errors: Iterable[ErrorEntry]) -> list[str]:
    """Return the types of errors."""
    return [each.error_type for each in errors]
