"""What fleet control tells, inside of the kernel's steps: who has to hear it."""

from __future__ import annotations

from collections.abc import Callable

from nena_order_service.fleet import (
    ActionRetriable,
    BaseWanted,
    FleetOutput,
    InstantActionEnded,
    LinkStatus,
    MissionAccepted,
    MissionCancelled,
    MissionFailed,
    MissionFinished,
    NodePassed,
    OperationStarted,
    RobotChanged,
    RobotView,
)
from nena_order_service.kernel.instant_actions import PendingInstantActions, state_request
from nena_order_service.kernel.order_flow import OrderFlow
from nena_order_service.kernel.ports import FleetControl
from nena_order_service.kernel.steps import Steps
from nena_order_service.traffic.driving import Driving
from nena_order_service.vehicles.positions import Places
from nena_order_service.vehicles.registry import VehicleRegistry
from nena_shared.vda5050.own_actions import transforms_itself
from nena_shared.vda5050.topics import RobotKey


class FleetNews:
    """Takes news of robots and missions to orders, driving and places."""

    def __init__(
        self,
        orders: OrderFlow,
        *,
        driving: Driving,
        places: Places,
        registry: VehicleRegistry,
        instant_actions: PendingInstantActions,
        steps: Steps,
        fleet: Callable[[], FleetControl],
    ) -> None:
        self._orders = orders
        self._driving = driving
        self._places = places
        self._registry = registry
        self._instant_actions = instant_actions
        self._steps = steps
        self._fleet = fleet
        self._asked: set[RobotKey] = set()

    def take(self, news: FleetOutput) -> None:
        """Take in one piece of news; what nobody here needs to know changes nothing."""
        match news:
            case RobotChanged(robot):
                self._robot_changed(robot)
            case InstantActionEnded():
                self._instant_actions.ended(news)
                self._orders.news.on_instant_action(news)
            case ActionRetriable():
                self._orders.news.on_retriable(news)
            case (
                MissionAccepted()
                | OperationStarted()
                | MissionFinished()
                | MissionFailed()
                | MissionCancelled()
            ):
                self._orders.news.on_mission(news)
                self._orders.tell_hindrance(self._registry.discover(news.robot))
            case NodePassed():
                self._driving.passed(news.mission_id, news.sequence_id)
            case BaseWanted():
                self._driving.base_wanted(news.mission_id)
            case _:
                pass

    def _robot_changed(self, robot: RobotKey) -> None:
        vehicle = self._registry.discover(robot)
        view = self._fleet().view(vehicle.key)
        if view.state and view.state.mobile_robot_position:
            vehicle = self._registry.learn_map(vehicle, view.state.mobile_robot_position.map_id)
        if view.factsheet:
            self._registry.learn_frame(vehicle, transforms_itself=transforms_itself(view.factsheet))
            vehicle = self._registry.discover(robot)
        self._ask_for_state(view)
        self._places.see(vehicle)
        self._steps.vehicle_changed(vehicle.name)
        self._driving.robot_changed(vehicle)
        self._orders.robot_changed(vehicle)

    def _ask_for_state(self, view: RobotView) -> None:
        """Ask a robot that is there and has told no state yet, so that nobody waits for its next one."""
        if view.link is not LinkStatus.ONLINE:
            self._asked.discard(view.key)
        elif view.state is None and view.key not in self._asked:
            self._asked.add(view.key)
            self._steps.after_commit(lambda: self._fleet().instant_action(view.key, state_request()))
