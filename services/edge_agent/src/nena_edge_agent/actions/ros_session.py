"""Instant actions that start and stop a robot's ROS session, and move it to another namespace or domain."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from nena_edge_agent.actions.plugin import (
    ActionPlugin,
    BackgroundAction,
    Report,
    RunningAction,
    WorkFailedError,
)
from nena_edge_agent.driver.port import SessionError
from nena_edge_agent.nav2.session_control import SessionManager, SessionStore
from nena_edge_agent.nav2.settings import BadAddressError, RosAddress, RosSettings
from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.own_actions import CONFIGURE_ROS_SESSION, START_ROS_SESSION, STOP_ROS_SESSION
from nena_shared.vda5050.state import Load
from nena_shared.vda5050.topics import RobotKey

INSTANT = (ActionScope.INSTANT,)
NAMESPACE = Parameter("namespace", ValueDataType.STRING, required=False, description="such as /r1")
DOMAIN_ID = Parameter("domainId", ValueDataType.INTEGER, required=False, description="0 to 232")
KEEP = Parameter("keep", ValueDataType.BOOL, required=False, description="keep after a restart; default: no")


class SessionSwitch:
    """Access of a robot's actions to its ROS session, which exists once its driver is created."""

    def __init__(self, settings: RosSettings, store: SessionStore | None) -> None:
        """Store the address in ``store`` for restarts; None: it is not stored."""
        self.settings = settings
        self.store = store
        self._manager: SessionManager | None = None

    @property
    def address(self) -> RosAddress:
        """Return the namespace and domain with which the robot starts."""
        return self.store.read(self.settings) if self.store else RosAddress.of(self.settings)

    def use_session(self, manager: SessionManager) -> None:
        """Use the session of a newly created driver."""
        self._manager = manager

    @property
    def manager(self) -> SessionManager:
        """Return the session; raise WorkFailedError if there is none."""
        if self._manager is None:
            raise WorkFailedError("the robot has not started yet")
        return self._manager


def session_switch(settings: RosSettings, journal: Path | None, robot: RobotKey) -> SessionSwitch:
    """Create the switch of one robot; the address is stored beside the robot's journal, if it has one."""
    return SessionSwitch(settings, SessionStore(journal, robot) if journal else None)


Work = Callable[[SessionSwitch, Action], Coroutine[None, None, None]]


@dataclass(frozen=True, slots=True)
class SessionAction:
    """Runs one session action; its result is the session's state and address."""

    declaration: ActionDeclaration
    work: Work
    switch: SessionSwitch

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        """Start the change; the action ends when the session has the requested state, or fails."""
        return BackgroundAction(action.action_id, partial(self._switch_session, action), report)

    async def _switch_session(self, action: Action) -> ActionReport:
        manager = self.switch.manager
        try:
            await self.work(self.switch, action)
        except SessionError as error:
            # The session continues to try: only this action has failed.
            raise WorkFailedError(f"{error}; {manager.address}; retried until it is stopped") from error
        return ActionReport(
            action.action_id, ActionStatus.FINISHED, f"ROS session {manager.state}, {manager.address}"
        )


def session_actions(switch: SessionSwitch) -> tuple[ActionPlugin, ...]:
    """Build the actions of one robot."""
    start = ActionDeclaration(
        START_ROS_SESSION, INSTANT, restartable=True, description="Connects the robot to ROS."
    )
    stop = ActionDeclaration(
        STOP_ROS_SESSION,
        INSTANT,
        restartable=True,
        needs_idle=True,
        description="Disconnects the robot from ROS; refused while an order is active.",
    )
    configure = ActionDeclaration(
        CONFIGURE_ROS_SESSION,
        INSTANT,
        parameters=(NAMESPACE, DOMAIN_ID, KEEP),
        restartable=True,
        needs_idle=True,
        description="Moves the robot to another namespace or domain; refused while an order is active.",
    )
    return (
        SessionAction(start, lambda switch, _: switch.manager.start(), switch),
        SessionAction(stop, lambda switch, _: switch.manager.stop(), switch),
        SessionAction(configure, _configure_session, switch),
    )


async def _configure_session(switch: SessionSwitch, action: Action) -> None:
    address, keep = _wanted_address(switch.manager.address, action), action.parameter(KEEP.key) is True
    if keep and switch.store is None:
        raise WorkFailedError("the address cannot be kept: journal.enabled is false")
    if keep and switch.store:  # first: a session that fails to start there is retried there
        try:
            await asyncio.to_thread(switch.store.write, address, switch.settings)
        except OSError as error:
            raise WorkFailedError(f"unchanged: the address cannot be stored: {error}") from error
    if address != switch.manager.address:
        await switch.manager.move(address)


def _wanted_address(address: RosAddress, action: Action) -> RosAddress:
    """Return the address that the action requests; missing parts stay unchanged."""
    namespace, domain_id = action.parameter(NAMESPACE.key), action.parameter(DOMAIN_ID.key)
    if namespace is None and domain_id is None:
        raise WorkFailedError("namespace or domainId required")
    try:
        return address.changed(
            namespace=namespace if isinstance(namespace, str) else None,
            domain_id=domain_id if isinstance(domain_id, int) else None,
        )
    except BadAddressError as error:
        raise WorkFailedError(str(error)) from error
