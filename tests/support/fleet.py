"""A fleet-control core and one honest robot, with a wire between them that the test holds in its hands."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from itertools import chain, count, pairwise
from typing import Any, TypeVar

from nena_conversations.kit.honest_robot import MAP, START, HonestRobot
from nena_order_service.fleet.controller import FleetController, RobotControl
from nena_order_service.fleet.outputs import (
    FleetOutput,
    Outputs,
    PublishInstantActions,
    PublishOrder,
    PublishResponses,
    RobotChanged,
    VdaOrderCancelled,
    VdaOrderFailed,
    VdaOrderFinished,
)
from nena_order_service.fleet.robot import RobotView
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.vda_order import VdaOrder
from nena_shared.vda5050.action import Action, ActionParameter, BlockingType, InstantActions
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.order import AllowedDeviationXY, Edge, Node, NodePosition, Order

T = TypeVar("T")

ENDS = (VdaOrderFinished, VdaOrderFailed, VdaOrderCancelled)


def make_vda_order(name: str, *points: str, operation: str | None = None, x: float = 0.0) -> VdaOrder:
    """Make a VDA order along points that lie 1 m apart, the first at ``x``; an operation at its end."""
    last = len(points) - 1
    action = (
        ()
        if operation is None
        else (
            Action(action_type=operation, action_id=f"{name}/{operation}", blocking_type=BlockingType.HARD),
        )
    )
    return VdaOrder(
        order_id=name,
        nodes=tuple(
            Node(
                node_id=point,
                sequence_id=2 * index,
                released=True,
                node_position=NodePosition(
                    x=x + index, y=0.0, map_id=MAP, allowed_deviation_xy=AllowedDeviationXY(a=0.5, b=0.5)
                ),
                actions=action if index == last else (),
            )
            for index, point in enumerate(points)
        ),
        edges=tuple(
            Edge(edge_id=f"{a}-{b}", sequence_id=2 * index + 1, released=True, actions=())
            for index, (a, b) in enumerate(pairwise(points))
        ),
    )


def make_action(
    action_type: str, action_id: str = "i1", blocking: BlockingType = BlockingType.NONE, **values: Any
) -> Action:
    """Make an action with these parameters."""
    return Action(
        action_type=action_type,
        action_id=action_id,
        blocking_type=blocking,
        action_parameters=tuple(ActionParameter(key=key, value=value) for key, value in values.items()),
    )


class Bench:
    """A test bench: time only passes in :meth:`wait`; messages wait until :meth:`deliver`."""

    def __init__(self, settings: FleetSettings | None = None, robot: HonestRobot | None = None) -> None:
        numbers = count(1)
        self.settings = settings or FleetSettings()
        self.fleet = FleetController(self.settings, new_id=lambda: f"id-{next(numbers)}")
        self.robot = robot or HonestRobot()
        self.now = 100.0
        self.wire: list[PublishOrder | PublishInstantActions] = []
        self.sent: list[PublishOrder | PublishInstantActions] = []
        self.answers: list[PublishResponses] = []
        self.news: list[FleetOutput] = []

    def online(self) -> Bench:
        """Connect the broker and the robot, and make the robot known."""
        self.set_broker(connected=True)
        self.connection(ConnectionState.ONLINE)
        self.report()
        return self

    @property
    def key(self) -> object:
        return self.robot.key

    @property
    def control(self) -> RobotControl:
        return self.fleet.control(self.robot.key)

    def take(self, outputs: Iterable[FleetOutput]) -> Outputs:
        outputs = tuple(outputs)
        for output in outputs:
            if isinstance(output, PublishResponses):
                self.answers.append(output)
            elif isinstance(output, PublishOrder | PublishInstantActions):
                self.wire.append(output)
                self.sent.append(output)
            else:
                self.news.append(output)
        return outputs

    def set_broker(self, *, connected: bool, unread: bool = False) -> None:
        """Lose or regain our own link; ``unread``: as a new leader."""
        self.fleet.on_broker(connected=connected, now=self.now, unread=unread)
        self.tick()

    def connection(self, state: ConnectionState) -> Outputs:
        """Deliver a connection message, and the factsheet retained at the broker."""
        self.take(self.fleet.on_factsheet(self.robot.key, self.robot.factsheet(), self.now))
        message = self.robot.connection(state, self.now)
        return self.take(self.fleet.on_connection(self.robot.key, message, self.now))

    def report(self) -> Outputs:
        """Deliver a state of the robot."""
        return self.take(self.fleet.on_state(self.robot.key, self.robot.state(self.now), self.now))

    def start(self, vda_order: VdaOrder) -> Outputs:
        return self.take(self.control.start_order(vda_order, self.now))

    def start_and_tell(self, vda_order: VdaOrder) -> None:
        """Start a VDA order, have the robot get it, and hear so."""
        self.start(vda_order)
        self.exchange()

    def cancel(self) -> Outputs:
        return self.take(self.control.cancel_order(self.now))

    def instruct(self, action: Action) -> Outputs:
        return self.take(self.control.send_instant_action(action, self.now))

    def tick(self) -> Outputs:
        return self.take(tuple(chain.from_iterable(self.fleet.tick(self.now))))

    def wait(self, seconds: float, *, reporting: bool = False) -> None:
        """Advance the time, with a tick each quarter of a second, and with a state each second on request."""
        for quarter in range(1, int(seconds * 4) + 1):
            self.now += 0.25
            if reporting and quarter % 4 == 0:
                self.report()
            self.tick()

    def deliver(self) -> None:
        """Hand what lies on the wire to the robot."""
        while self.wire:
            hand_over(self.wire.pop(0), self.robot)

    def exchange(self) -> Outputs:
        """Hand what lies on the wire to the robot, and deliver its state after that."""
        self.deliver()
        return self.report()

    def lose(self) -> None:
        """Lose what lies on the wire."""
        self.wire.clear()

    def run(self, steps: int = 20) -> None:
        """Run ``steps`` steps: deliver, drive a step, report."""
        for _ in range(steps):
            self.now += 0.5
            self.deliver()
            self.robot.step()
            self.report()
            self.tick()

    def view(self) -> RobotView:
        return self.fleet.view(self.robot.key, self.now)

    def told(self, kind: type[T]) -> list[T]:
        return [each for each in self.news if isinstance(each, kind)]

    def ends(self) -> Counter[str]:
        """Count the reported ends, by VDA order."""
        return Counter(each.order_id for each in self.news if isinstance(each, ENDS))

    def story(self) -> list[str]:
        """Name the news but RobotChanged."""
        return [type(each).__name__ for each in self.news if not isinstance(each, RobotChanged)]

    def orders_sent(self) -> list[str]:
        return [each.vda_order.order_id for each in self.sent if isinstance(each, PublishOrder)]

    def instants_sent(self) -> list[str]:
        return [
            action.action_type
            for each in self.sent
            if isinstance(each, PublishInstantActions)
            for action in each.actions
        ]


def hand_over(output: PublishOrder | PublishInstantActions, robot: HonestRobot) -> None:
    """Deliver a message to a robot."""
    if isinstance(output, PublishOrder):
        robot.take_order(order_of(output.vda_order, robot, output.order_update_id))
    else:
        robot.take_instant_actions(instants_of(output.actions, robot))


def order_of(vda_order: VdaOrder, robot: HonestRobot, update_id: int = 0) -> Order:
    return Order(
        header_id=0,
        timestamp=START,
        version="2.1.0",
        manufacturer=robot.key.manufacturer,
        serial_number=robot.key.serial_number,
        order_id=vda_order.order_id,
        order_update_id=update_id,
        nodes=vda_order.nodes,
        edges=vda_order.edges,
    )


def instants_of(actions: Iterable[Action], robot: HonestRobot) -> InstantActions:
    return InstantActions(
        header_id=0,
        timestamp=START,
        version="2.1.0",
        manufacturer=robot.key.manufacturer,
        serial_number=robot.key.serial_number,
        actions=tuple(actions),
    )
