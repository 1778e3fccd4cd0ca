"""The engine: all changes of orders, vehicles and traffic happen here, in one event loop.

Each event is a *unit of work*: it changes the state and records effects, such as a VDA 5050 order to send.
The changes are committed first; then the effects run and the changes are published. Everything that hosts or
robots have received therefore survives a restart.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field

from nena_order_service.engine.conditions import Sequences
from nena_order_service.engine.context import Context, FleetControl
from nena_order_service.engine.dispatching import Dispatching
from nena_order_service.engine.driving import Driving, Pauses, RestartGate, Stuck
from nena_order_service.engine.idle import IdleVehicles
from nena_order_service.engine.life_cycle import LifeCycle
from nena_order_service.engine.order_knowledge import OrderFit
from nena_order_service.engine.peripherals import Peripherals
from nena_order_service.engine.positions import Positions
from nena_order_service.engine.recovery import Recovery
from nena_order_service.engine.rerouting import Rerouted, Rerouting
from nena_order_service.engine.state import PERIPHERAL_JOB
from nena_order_service.engine.status import StatusReporter
from nena_order_service.engine.stops import STOP, STOPPED_ROBOT, FleetStop, Stops
from nena_order_service.engine.traffic_plan import TrafficPlans
from nena_order_service.engine.unit_of_work import UnitOfWork
from nena_order_service.fleet import outputs
from nena_order_service.fleet.robot import RobotView
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.peripherals.jobs import PeripheralJob
from nena_order_service.store.store import Store
from nena_order_service.vehicles.registry import FleetVehicle
from nena_shared.fleet_api.peripherals import (
    DeviceAnswer,
    PeripheralJobRequest,
    PeripheralState,
)
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.requests import SOMEBODY
from nena_shared.fleet_api.stops import DirectStop, StopRequest
from nena_shared.fleet_api.transport_order import (
    OrderOutcome,
    TransportOrderRequest,
)
from nena_shared.fleet_api.vehicle import AcceptableOrderType, IntegrationLevel, ReroutingType
from nena_shared.histogram import SHORT, Histogram
from nena_shared.log import get_logger
from nena_shared.tasks import set_within
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.own_actions import transforms_itself
from nena_shared.vda5050.topics import RobotKey

R = ReasonCode

log = get_logger(__name__)

CHECK_INTERVAL = 2.0
"""Seconds between checks for changes without an event, such as timeouts."""

CHECK_SHARE = 0.1
"""Largest share of a core for looking at all vehicles, as for their positions: in a large fleet, most checks
leave it out."""

FIRST_CHECK_INTERVAL = 0.2
"""Seconds between checks while the first states of robots are awaited after the start."""

DISPATCH_SHARE = 1 / 6
"""Largest share of the event loop's work for decisions of the dispatcher that take long."""

LONG_DECISION = 0.005
"""Seconds from which a decision is long."""


@dataclass(frozen=True, slots=True)
class Timings:
    """Durations of the engine's tasks."""

    dispatch: Histogram = field(default_factory=lambda: Histogram(SHORT))
    traffic: Histogram = field(default_factory=lambda: Histogram(SHORT))


class Engine:
    """Owns the state and the flows that change it."""

    def __init__(self, context: Context, store: Store) -> None:
        self.context = context
        self.state = context.state
        self.plant = context.plant
        self.registry = context.registry
        self.traffic = context.traffic
        self.clock = context.clock
        self.settings = context.settings
        self.store = store
        self.sequences = Sequences(context)
        self._check_due = asyncio.Event()
        self._gate = RestartGate(context, self._check_due.set)
        self._positions = Positions(context)
        self.peripherals = Peripherals(context)
        pauses = Pauses(context, self.peripherals)
        self.stops = Stops(context)
        self._driving = Driving(
            context, self._positions, pauses, self._gate, self.peripherals, stops=self.stops
        )
        fit = OrderFit(context.state.vehicles, self.sequences)
        self.dispatching = Dispatching(context, self._driving, fit)
        self.life_cycle = LifeCycle(
            context, self._driving, self.dispatching, self.sequences, pauses, peripherals=self.peripherals
        )
        self._idle = IdleVehicles(context, self.dispatching, self.life_cycle)
        self._rerouting = Rerouting(context, self._driving)
        self.traffic_plans = TrafficPlans(context, self._driving)
        self.reporter = StatusReporter(
            context, self._driving, self.dispatching, self.sequences, self._idle, stops=self.stops
        )
        self.timings = Timings()
        self._dispatch_pause: asyncio.TimerHandle | None = None
        """Ends the pause after a long decision."""
        self.unit_of_work = UnitOfWork(
            self.state,
            store,
            self.reporter.status_of,
            self.on_events,
            timeout=self.settings.commit_timeout,
        )

    def prepare(self) -> None:
        """Build the routing graphs; call it before :meth:`start`, in any thread."""
        self.context.finder.prepare(vehicle.model for vehicle in self.registry)

    async def load_stops(self) -> None:
        """Restore the stops from before a restart; call it before :meth:`start`."""
        self.stops.load(await self.store.documents(STOP), await self.store.documents(STOPPED_ROBOT))

    async def start(self, fleet: FleetControl) -> None:
        """Restore unfinished orders and vehicles from the store; call it before the first robot message."""
        self.context.connect(fleet)
        stored = await self.store.read_unfinished()
        self.state.orders.last_number = stored.last_number
        for order in stored.orders:
            self.state.orders.load(order)
        self.state.sequences.load(stored.sequences, stored.last_sequence)
        self.state.vehicles.load(stored.vehicles)
        jobs = await self.store.documents(PERIPHERAL_JOB)
        recovery = Recovery(self.context, self._gate)
        with self.change():
            self.peripherals.restore(jobs)
            recovery.restore_vehicles(stored.relocations)
            self.state.sequences.rebind_vehicles(recovery.present_name)
            self.life_cycle.restore_orders(stored.orders, stored.drives, recovery)
            self._rerouting.reroute_off_locked_paths()
        await self.unit_of_work.committed()
        log.info("orders loaded", unfinished=len(stored.orders), last_number=stored.last_number)

    async def run(self) -> None:
        """Check periodically for changes without an event, until cancelled."""
        clock = asyncio.get_running_loop().time
        vehicles_due = clock()
        while True:
            await set_within(self._check_due, CHECK_INTERVAL if self._gate.is_open else FIRST_CHECK_INTERVAL)
            self._check_due.clear()
            vehicles = [*self.registry] if clock() >= vehicles_due else []
            begin = self.clock.cpu()
            try:
                self.run_checks(vehicles)
            except Exception:
                if not self.unit_of_work.failed.is_set():
                    raise
                await asyncio.Event().wait()  # for ever: another engine is built from the store
            if vehicles:
                vehicles_due = clock() + (self.clock.cpu() - begin) / CHECK_SHARE

    def close(self, reason: str) -> None:
        """Accept no more changes, because another engine takes over the store."""
        self.unit_of_work.closed = reason

    @contextmanager
    def change(self) -> Iterator[None]:
        """Make changes and all steps that follow from them in one unit of work."""
        with self.unit_of_work.begin():
            yield
            self._dispatch_and_drive()

    def _dispatch_and_drive(self) -> None:
        """Dispatch and drive until no more steps follow from the changes."""
        while self.state.orders.any_ended or self._decision_due or self.state.drive_due:
            for job in self.peripherals.pop_failed_jobs():
                self.life_cycle.on_failed_peripheral(job)
            self.life_cycle.conditions.apply_ended_orders()
            if self._decision_due:
                self._run_dispatcher()
            with self.timings.traffic.timed():
                for outcome in self._driving.let_drive():
                    if isinstance(outcome, Stuck):
                        self.life_cycle.on_stuck_vehicle(outcome)
                    else:
                        self.life_cycle.update_reason(outcome)

    @property
    def _decision_due(self) -> bool:
        return self.state.dispatch_due and self._dispatch_pause is None

    def _run_dispatcher(self) -> None:
        """Run the dispatcher; after a long decision, not again before some time.

        A decision is about all free vehicles and waiting orders, so it may take long in a large fleet, where
        vehicles and orders change all the time.
        """
        begin = self.clock.cpu()
        with self.timings.dispatch.timed():
            self.life_cycle.dispatch_orders()
        # Not the time that passed: 2 ms of work that others held up for 80 ms delayed the next one by 400 ms.
        seconds = self.clock.cpu() - begin
        if seconds > LONG_DECISION:
            # Robots' states and hosts get five times as long as the decision has held them up.
            pause = seconds * (1 / DISPATCH_SHARE - 1)
            self._dispatch_pause = asyncio.get_running_loop().call_later(pause, self._end_dispatch_pause)

    def _end_dispatch_pause(self) -> None:
        self._dispatch_pause = None
        if self.state.dispatch_due and not self.unit_of_work.closed:
            with self.change():
                pass  # a change ends with what is due

    def run_checks(self, vehicles: Collection[FleetVehicle] | None = None) -> None:
        """Retry waiting work, and publish those of the vehicles (None: all) that changed without an event."""
        vehicles = [*self.registry] if vehicles is None else vehicles
        with self.unit_of_work.begin():
            for vehicle in vehicles:
                self._positions.update_held(vehicle)
                self.stops.pause_or_resume(vehicle)
            self._driving.note_stopped()
        # Each in its own unit: a new route changes what the next vehicle waits for.
        for name in self._rerouting.next_waiting():
            with self.change():
                self._rerouting.reroute_waiting(name)
        with self.change():
            self.state.dispatch_due = self.state.drive_due = True
            self.life_cycle.check_times()
            self.peripherals.check_times()
        # Parking and recharging wait for the first states of all robots: a place may be occupied.
        if self._gate.is_open:
            with self.change():
                self._idle.send_idle(vehicles)
        # Positions and ages change all the time, so only a change of the essentials is published.
        with self.unit_of_work.begin():
            for vehicle in vehicles if self.unit_of_work.vehicle_listeners else ():
                if not self.unit_of_work.is_published(vehicle.name, self.reporter.essentials(vehicle)):
                    self.state.vehicle_changed(vehicle.name)

    # Requests of hosts

    def create(
        self,
        request: TransportOrderRequest,
        name: str,
        ended: Mapping[str, OrderOutcome] | None = None,
        by: str | None = None,
    ) -> TransportOrder:
        """Create an order from a validated request; see :meth:`LifeCycle.create_order`."""
        with self.change():
            order = self.life_cycle.create_order(request, name, ended, by=by)
        return self.state.orders.get(order.number)

    def withdraw(self, number: int, reason: str, *, immediate: bool = True) -> None:
        """Withdraw an order that has not ended; see :meth:`LifeCycle.withdraw_order`."""
        with self.change():
            self.life_cycle.withdraw_order(self.state.orders.get(number), reason, immediate=immediate)

    def hold(self, number: int, by: str, reason: str, *, immediate: bool = True) -> None:
        """Hold an order that has neither ended nor been withdrawn; see :meth:`LifeCycle.hold_order`."""
        with self.change():
            self.life_cycle.hold_order(self.state.orders.get(number), by, reason, immediate=immediate)

    def resume(self, number: int, by: str, reason: str) -> None:
        """Resume a held order; see :meth:`LifeCycle.resume_order`."""
        with self.change():
            self.life_cycle.resume_order(self.state.orders.get(number), by, reason)

    def change_order(self, number: int, changes: Mapping[str, object]) -> None:
        """Change an order that no vehicle has; see :meth:`LifeCycle.change_order`."""
        with self.change():
            self.life_cycle.change_order(self.state.orders.get(number), changes)

    def reroute(self, vehicle: FleetVehicle, kind: ReroutingType) -> Rerouted:
        """Replan the route of a vehicle's order; see :meth:`Rerouting.request`."""
        with self.change():
            return self._rerouting.reroute_on_request(vehicle, kind)

    def set_integration_level(
        self, vehicle: FleetVehicle, level: IntegrationLevel, by: str = SOMEBODY
    ) -> None:
        """Set the integration level of a vehicle for ``by``.

        At a level without resources (openTCS: TO_BE_IGNORED, TO_BE_NOTICED), the vehicle loses its order and
        all resources that it holds: the host has made sure that it blocks no other vehicle.
        """
        with self.change():
            if not level.holds_resources:
                sent = self.state.drives.sent.get(vehicle.key)
                reason = Reason(R.LEVEL_SET, vehicle=vehicle.name, level=level.value)
                self.life_cycle.fail_order_of(vehicle.key, reason)
                self._driving.drop_drive(vehicle)
                if sent:
                    self.state.after_commit(lambda: self.context.fleet.cancel_vda_order(vehicle.key))
            self._positions.set_level(vehicle, level, by)
            self.state.dispatch_due = self.state.drive_due = True
            self.state.vehicle_changed(vehicle.name)

    def accept_order_types(self, vehicle: FleetVehicle, types: tuple[AcceptableOrderType, ...]) -> None:
        """Set the order types that a vehicle accepts; its current order is not affected."""
        with self.change():
            self.dispatching.fit.set_order_types(vehicle, types)
            self.state.dispatch_due = True
            self.state.vehicle_changed(vehicle.name)

    def send_instant_action(
        self, vehicle: FleetVehicle, action: Action
    ) -> asyncio.Future[outputs.InstantActionEnded]:
        """Send an instant action (section 6.2.1); the future is done when it has ended."""
        end = self.state.instant_actions.expect(action.action_id)
        self.context.fleet.instant_action(vehicle.key, action)
        return end

    def begin_stop(self, request: StopRequest, by: str) -> FleetStop:
        """Pause all robots, or those in an area, and reroute others around it; see :meth:`Stops.begin`."""
        return self._change_stops(lambda: self.stops.begin(request, by))

    def continue_stop(self, direct: DirectStop) -> FleetStop:
        """Continue a stop that the status aggregator has begun; see :meth:`Stops.continue_direct`."""
        return self._change_stops(lambda: self.stops.continue_direct(direct))

    def end_stop(self, name: str, by: str, reason: str) -> FleetStop:
        """End a stop; see :meth:`Stops.end`."""
        return self._change_stops(lambda: self.stops.end(name, by, reason))

    def person_pauses(self, vehicle: FleetVehicle) -> None:
        """Note that a host pauses a vehicle; see :meth:`Stops.person_pauses`."""
        if not self.unit_of_work.closed:
            with self.unit_of_work.begin():
                self.stops.person_pauses(vehicle)

    def _change_stops(self, change: Callable[[], FleetStop]) -> FleetStop:
        # Robots are paused in a unit of work of their own, without the driving that ends each change: no base
        # is extended into an area before routes are replanned around it.
        with self.unit_of_work.begin():
            stop = change()
            for vehicle in self.registry:
                self.stops.pause_or_resume(vehicle)
                self.life_cycle.update_reason(vehicle)
                self.state.vehicle_changed(vehicle.name)
        if stop.area:
            self.plant_changed()
        else:
            with self.change():
                self.state.dispatch_due = self.state.drive_due = True
        return stop

    def create_peripheral_job(self, request: PeripheralJobRequest, name: str) -> PeripheralJob:
        """Create a peripheral job; see :meth:`Peripherals.create`."""
        with self.change():
            return self.peripherals.create_job(request, name)

    def withdraw_peripheral_job(self, name: str, reason: str) -> None:
        """Withdraw a peripheral job; see :meth:`Peripherals.withdraw`."""
        with self.change():
            self.peripherals.withdraw_job(name, reason)

    def on_device_answer(self, location: str, answer: DeviceAnswer) -> None:
        """Handle the answer of a peripheral device."""
        if self.peripherals.is_new_answer(location, answer) and not self.unit_of_work.closed:
            with self.change():
                self.peripherals.on_answer(location, answer)

    def on_device_state(self, location: str, state: PeripheralState) -> None:
        """Handle the state that a peripheral device reports."""
        if self.peripherals.is_new_state(location, state) and not self.unit_of_work.closed:
            with self.change():
                self.peripherals.on_state(location, state)

    def plant_changed(self) -> None:
        """Replan all routes, including the horizons of driving vehicles, then check all orders."""
        self.context.routes.forget_routes()
        self.traffic.forget_routes()
        self.dispatching.knowledge.forget_routes()
        with self.change():
            self._rerouting.reroute_off_locked_paths()
            self.state.dispatch_due = self.state.drive_due = True
        self._check_due.set()

    # Queries

    def view(self, vehicle: FleetVehicle) -> RobotView:
        """Return the known state of a vehicle's robot."""
        return self.context.view(vehicle)

    # Events of fleet control

    def on_events(self, *events: outputs.FleetOutput) -> None:
        """Handle events of fleet control in one unit of work."""
        if self.unit_of_work.closed:
            return
        with self.change():
            for event in events:
                self._on_event(event)

    def _on_event(self, event: outputs.FleetOutput) -> None:
        match event:
            case outputs.RobotChanged(robot):
                self._robot_changed(robot)
            case outputs.BrokerLinkChanged():
                self.state.dispatch_due = True
                self.stops.link_changed()
                self._check_due.set()
            case outputs.InstantActionEnded():
                self.state.instant_actions.ended(event)
                self.life_cycle.on_instant_action(event)
                self.stops.on_action_ended(event)
            case outputs.ActionRetriable():
                self.life_cycle.on_retriable_action(event)
            case (
                outputs.VdaOrderAccepted()
                | outputs.OperationStarted()
                | outputs.VdaOrderFinished()
                | outputs.VdaOrderFailed()
                | outputs.VdaOrderCancelled()
            ):
                self.life_cycle.on_order_event(event)
                self.life_cycle.update_reason(self.registry.discover(event.robot))
            case outputs.NodePassed():
                self._driving.pass_node(event.robot, event.order_id, event.sequence_id)
            case outputs.BaseWanted():
                self._driving.extend_base(event.robot, event.order_id)
            case _:
                pass

    def _robot_changed(self, robot: RobotKey) -> None:
        vehicle = self.registry.discover(robot)
        view = self.context.view(vehicle)
        # A robot without a map or frame in the plant model is on the map, and in the frame, that it reports.
        if view.state and view.state.mobile_robot_position:
            vehicle = self.registry.learn_map(vehicle, view.state.mobile_robot_position.map_id)
        if view.factsheet:
            self.registry.learn_frame(vehicle, transforms_itself=transforms_itself(view.factsheet))
            vehicle = self.registry.discover(robot)
        self._positions.update_held(vehicle)
        self.state.vehicle_changed(vehicle.name)
        if not self.context.traffic.route_of(vehicle.name):  # others report passed nodes
            self.state.drive_due = True
        self.stops.pause_or_resume(vehicle)
        self.life_cycle.robot_changed(vehicle, view)
