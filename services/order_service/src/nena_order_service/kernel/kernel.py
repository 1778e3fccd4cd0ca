"""The kernel: every change of orders, vehicles and missions is made here, in one event loop."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from nena_order_service.dispatching.dispatcher import VehicleFit
from nena_order_service.dispatching.manager import Dispatching, OrderFit
from nena_order_service.dispatching.settings import DispatchSettings
from nena_order_service.dispatching.way import WayFinder
from nena_order_service.fleet import FleetOutput, InstantActionEnded, RobotView
from nena_order_service.kernel.fleet_news import FleetNews
from nena_order_service.kernel.instant_actions import PendingInstantActions
from nena_order_service.kernel.mission_book import MissionBook
from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.order_flow import OrderFlow
from nena_order_service.kernel.ports import FleetControl
from nena_order_service.kernel.sequence_book import SequenceBook
from nena_order_service.kernel.settings import KernelSettings
from nena_order_service.kernel.steps import Steps
from nena_order_service.kernel.vehicle_book import VehicleBook
from nena_order_service.kernel.vehicle_outlook import VehicleOutlook
from nena_order_service.orders.dependencies import Conditions
from nena_order_service.orders.rerouting import Rerouted, Rerouting
from nena_order_service.orders.sequences import Sequences
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.orders.vda_orders import MissionPlanner
from nena_order_service.recovery import Recovery
from nena_order_service.routing.vehicle_routes import VehicleWays
from nena_order_service.store.store import Store
from nena_order_service.traffic.desk import TrafficDesk
from nena_order_service.traffic.driving import Driving, Pauses, RestartGate
from nena_order_service.vehicles.idle import IdleVehicles
from nena_order_service.vehicles.positions import Places
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.clock import Clock
from nena_shared.fleet_api.transport_order import FailurePolicy, TransportOrderRequest, TransportOrderState
from nena_shared.fleet_api.vehicle import AcceptableOrderType, IntegrationLevel, ReroutingType, VehicleStatus
from nena_shared.log import get_logger
from nena_shared.plant import PlantModel
from nena_shared.vda5050.action import Action

log = get_logger(__name__)

LOOK_INTERVAL = 2.0
"""Seconds between looks at what changes without news: where robots stand, why vehicles have no order."""

FIRST_LOOKS = 0.2
"""Seconds between looks while robots are still waited for after the start."""


class Kernel:
    """Joins orders, dispatcher, traffic, fleet control and store.

    What happens comes in as a *step*: it changes the books and notes effects, such as a mission to send. The
    changes are committed, and only then are the effects done and the changes told. So whatever anybody has
    ever heard survives a restart.
    """

    def __init__(
        self,
        plant: PlantModel,
        *,
        store: Store,
        registry: VehicleRegistry,
        finder: WayFinder,
        planner: MissionPlanner,
        clock: Clock,
        settings: KernelSettings,
        on_failure: FailurePolicy = (),
    ) -> None:
        self.plant = plant
        self.store = store
        self.registry = registry
        self.book = OrderBook()
        self.instant_actions = PendingInstantActions()
        self.steps = Steps(self.book, store, lambda name: self._outlook.status_of(name))  # noqa: PLW0108 - made later
        self.clock = clock
        self._fleet: FleetControl | None = None
        self.sequence_book = SequenceBook(self.book, self.steps)
        self.sequences = Sequences(self.sequence_book, self.book, self.steps, clock)
        self._vehicles = VehicleBook(self.book, lambda robot: self.registry.discover(robot).name)
        self._missions = MissionBook(self.book, self._vehicles)
        self.finder = finder
        self._ways = VehicleWays(finder, registry)
        self.desk = TrafficDesk(plant, self._ways, exclusive=settings.traffic)
        self._gate = RestartGate(settings.restart_patience, clock, fleet=lambda: self.fleet, view=self.view)
        self._places = self._make_places(planner)
        self._pauses = Pauses(self.book, planner, self.view, clock)
        self._driving = self._make_driving(planner, settings.release_ahead)
        self._fit = OrderFit(self._vehicles, self.sequences)
        self._dispatching = self._make_dispatching(planner, settings.dispatch)
        self._orders = self._make_order_flow(planner, on_failure)
        self._idle = self._make_idle_vehicles(planner, settings.dispatch)
        self._rerouting = self._make_rerouting(planner)
        self._outlook = self._make_outlook()
        self._news = self._make_news()

    def _make_places(self, planner: MissionPlanner) -> Places:
        return Places(
            self.plant,
            self.desk,
            book=self._vehicles,
            registry=self.registry,
            planner=planner,
            view=self.view,
            clock=self.clock,
        )

    def _make_driving(self, planner: MissionPlanner, ahead: int) -> Driving:
        return Driving(
            self.desk,
            ahead=ahead,
            missions=self._missions,
            places=self._places,
            pauses=self._pauses,
            planner=planner,
            registry=self.registry,
            steps=self.steps,
            gate=self._gate,
            fleet=lambda: self.fleet,
            clock=self.clock,
            on_stuck=lambda robot, reason: self._orders.no_way(robot, reason),  # noqa: PLW0108 - made later
            on_busy=self.on_news,
        )

    def _make_dispatching(self, planner: MissionPlanner, settings: DispatchSettings) -> Dispatching:
        return Dispatching(
            self.plant,
            settings,
            registry=self.registry,
            book=self.book,
            missions=self._missions,
            planner=planner,
            finder=self.finder,
            driving=self._driving,
            fit=self._fit,
            view=self.view,
            clock=self.clock,
        )

    def _make_idle_vehicles(self, planner: MissionPlanner, settings: DispatchSettings) -> IdleVehicles:
        return IdleVehicles(
            self.plant,
            settings,
            recharges=planner.recharging,
            registry=self.registry,
            book=self.book,
            missions=self._missions,
            dispatching=self._dispatching,
            desk=self.desk,
            finder=self.finder,
            view=self.view,
            clock=self.clock,
            order=self._orders.create_automatic,
        )

    def _make_rerouting(self, planner: MissionPlanner) -> Rerouting:
        return Rerouting(
            self.plant,
            self.desk,
            book=self.book,
            missions=self._missions,
            driving=self._driving,
            planner=planner,
            finder=self.finder,
            registry=self.registry,
            clock=self.clock,
            view=self.view,
        )

    def _make_order_flow(self, planner: MissionPlanner, policy: FailurePolicy) -> OrderFlow:
        return OrderFlow(
            self.plant,
            book=self.book,
            missions=self._missions,
            dispatching=self._dispatching,
            driving=self._driving,
            pauses=self._pauses,
            policy=policy,
            conditions=Conditions(self.book, self.sequences, self.clock),
            sequences=self.sequences,
            registry=self.registry,
            finder=self.finder,
            planner=planner,
            steps=self.steps,
            clock=self.clock,
            view=self.view,
        )

    def _make_outlook(self) -> VehicleOutlook:
        return VehicleOutlook(
            self.plant,
            book=self.book,
            missions=self._missions,
            places=self._places,
            fit=self._fit,
            sequences=self.sequences,
            dispatching=self._dispatching,
            idle=self._idle,
            desk=self.desk,
            registry=self.registry,
            clock=self.clock,
            view=self.view,
        )

    def _make_news(self) -> FleetNews:
        return FleetNews(
            self._orders,
            driving=self._driving,
            places=self._places,
            registry=self.registry,
            instant_actions=self.instant_actions,
            steps=self.steps,
            fleet=lambda: self.fleet,
        )

    @property
    def fleet(self) -> FleetControl:
        """Fleet control; there from :meth:`start` on."""
        if self._fleet is None:
            message = "start the kernel before anything is asked of it"
            raise RuntimeError(message)
        return self._fleet

    async def start(self, fleet: FleetControl) -> None:
        """Take up all that is not at its end; before the first message of a robot comes."""
        self._fleet = fleet
        found = await self.store.unfinished()
        self.book.last_number = found.last_number
        for order in found.orders:
            self.book.load(order)
        self.sequence_book.load(found.sequences, found.last_sequence)
        self._vehicles.load(found.vehicles)
        recovery = Recovery(
            self.plant,
            self.desk,
            self.registry,
            self._vehicles,
            self._missions,
            self._driving,
            self._gate,
            self.steps,
            fleet,
        )
        with self.step():
            recovery.take_up_vehicles()
            self.sequence_book.rebind(recovery.present_name)
            self._orders.take_up(found.orders, found.missions, recovery)
            self._rerouting.keep_off_locked_paths()
        await self.steps.committed()
        log.info("orders taken up", unfinished=len(found.orders), last_number=found.last_number)

    async def run(self) -> None:
        """Look again and again at what changes without news, until cancelled."""
        while True:
            await asyncio.sleep(LOOK_INTERVAL if self._gate.is_open else FIRST_LOOKS)
            self.look()

    def close(self, reason: str) -> None:
        """Change nothing any more: another kernel takes up what is in the store."""
        self.steps.closed = reason

    def look(self) -> None:
        """Try again whatever waits, and tell vehicles that stand otherwise than was told."""
        with self.step():
            self._orders.dispatch_due = self._driving.due = True
            self._orders.note_deadlines()
            self._orders.end_late_ones()
            for vehicle in self.registry:
                self._places.see(vehicle)
        if self._gate.is_open:
            with self.step():
                self._idle.attend()
        with self.step():
            for vehicle in self.registry:
                if not self.steps.vehicle_as_told(vehicle.name, self._outlook.essentials(vehicle)):
                    self.steps.vehicle_changed(vehicle.name)

    def plant_changed(self) -> None:
        """Look anew for each way, also behind what vehicles under way were told to drive."""
        self._ways.forget()
        self._dispatching.forget()
        with self.step():
            self._rerouting.keep_off_locked_paths()
        self.look()

    def reroute(self, vehicle: FleetVehicle, kind: ReroutingType) -> Rerouted:
        """Plan the way of a vehicle's order anew; see :meth:`Rerouting.request`."""
        with self.step():
            return self._rerouting.request(vehicle, kind)

    @contextmanager
    def step(self) -> Iterator[None]:
        """Make changes, and what they let be dispatched; they are told and done when they are committed."""
        with self.steps.step():
            yield
            while self._orders.settle_due or self._orders.dispatch_due or self._driving.due:
                self._orders.settle()
                if self._orders.dispatch_due:
                    self._orders.dispatch()
                for vehicle in self._driving.let_drive():
                    self._orders.tell_hindrance(vehicle)

    def create(
        self,
        request: TransportOrderRequest,
        name: str,
        ended: Mapping[str, TransportOrderState] | None = None,
    ) -> TransportOrder:
        """Make an order from a request that was checked; see :meth:`OrderFlow.create`."""
        with self.step():
            order = self._orders.create(request, name, ended)
        return self.book.get(order.number)

    def withdraw(self, number: int, reason: str, *, immediate: bool = True) -> None:
        """Withdraw an order that is not at its end; see :meth:`OrderFlow.withdraw`."""
        with self.step():
            self._orders.withdraw(self.book.get(number), reason, immediate=immediate)

    def hold(self, number: int, by: str, reason: str, *, immediate: bool = True) -> None:
        """Let an order wait that is neither at its end nor withdrawn; see :meth:`Holding.hold`."""
        with self.step():
            self._orders.holding.hold(self.book.get(number), by, reason, immediate=immediate)

    def resume(self, number: int, by: str, reason: str) -> None:
        """Let a held order go on; see :meth:`Holding.resume`."""
        with self.step():
            self._orders.holding.resume(self.book.get(number), by, reason)

    def set_integration_level(self, vehicle: FleetVehicle, level: IntegrationLevel) -> None:
        """Let a vehicle count so much from now on.

        One for which nothing is kept free any more gives up its order, and all that it holds: whoever says
        so has seen to it that it is in nobody's way.
        """
        with self.step():
            if not level.holds_resources:
                record = self._missions.of_robot(vehicle.key)
                self._orders.give_up(vehicle.key, f"vehicle {vehicle.name} was given the level {level.value}")
                self._driving.take_out(vehicle)
                if record:
                    self.steps.after_commit(lambda: self.fleet.cancel_mission(vehicle.key))
            self._places.set_level(vehicle, level)
            self._orders.dispatch_due = self._driving.due = True
            self.steps.vehicle_changed(vehicle.name)

    def accept_order_types(self, vehicle: FleetVehicle, types: tuple[AcceptableOrderType, ...]) -> None:
        """Let a vehicle accept orders of these types from now on; an order that it has it does to the end."""
        with self.step():
            self._fit.accept(vehicle, types)
            self._orders.dispatch_due = True
            self.steps.vehicle_changed(vehicle.name)

    def send_instant_action(
        self, vehicle: FleetVehicle, action: Action
    ) -> asyncio.Future[InstantActionEnded]:
        """Send an instant action; the future is done at its end."""
        end = self.instant_actions.expect(action.action_id)
        self.fleet.instant_action(vehicle.key, action)
        return end

    def view(self, vehicle: FleetVehicle) -> RobotView:
        """Give what fleet control knows of a vehicle's robot."""
        return self.fleet.view(vehicle.key)

    def works(self, vehicle: FleetVehicle) -> bool:
        """Tell whether a vehicle works on an order."""
        return self._missions.order_number(vehicle.key) is not None

    def status(self, vehicle: FleetVehicle) -> VehicleStatus:
        """Tell how a vehicle stands."""
        return self._outlook.status(vehicle)

    def explain(self, order: TransportOrder) -> list[VehicleFit]:
        """Say of each vehicle why it does not do an order, or that it could."""
        return self._dispatching.explain(order)

    def on_news(self, *news: FleetOutput) -> None:
        """Take in what fleet control tells at a time, in one step."""
        if self.steps.closed:
            return
        with self.step():
            for each in news:
                self._news.take(each)
