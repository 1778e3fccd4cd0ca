"""The processes of Nav2: which of them run, their lifecycle states, and their parameters.

Each can die or hang alone, as in a Nav2 that is not composed. One that starts again is unconfigured: it works
after its lifecycle manager has configured and activated it.

A lifecycle manager misses a server that is dead, hangs or was started again, by its bond. Then it resets the
group as Nav2's does: it deactivates the servers in reverse order, waits for one without an answer, and cleans
them up. When all run again, it brings them up.

A process that was killed stays listed in the ROS graph until its DDS lease ends. A lifecycle manager that
tells a listed one to deactivate waits for its answer for ever, and has to be started again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum, StrEnum

BOND_TIMEOUT = 4.0
"""Seconds without a server's heartbeat after which its lifecycle manager resets the group."""
CLEANING = 0.2
"""Seconds from the deactivation of a group to its cleaning up, in which its goals end."""
RESPAWN_CHECK = 1.0
"""Seconds between two checks of a lifecycle manager whether all servers run again."""
RESPAWN_WAIT = 10.0
"""Seconds after which a lifecycle manager stops checking this (``bond_respawn_max_duration``)."""


class Server(StrEnum):
    """A process of Nav2, by the name of its node."""

    NAVIGATOR = "bt_navigator"
    CONTROLLER = "controller_server"
    PLANNER = "planner_server"
    BEHAVIOURS = "behavior_server"
    LOCALISATION = "amcl"
    MAPS = "map_server"
    MANAGER = "lifecycle_manager_navigation"
    LOCALISATION_MANAGER = "lifecycle_manager_localization"


MANAGED: Mapping[Server, tuple[Server, ...]] = {
    Server.MANAGER: (Server.CONTROLLER, Server.PLANNER, Server.BEHAVIOURS, Server.NAVIGATOR),
    Server.LOCALISATION_MANAGER: (Server.MAPS, Server.LOCALISATION),
}
"""The servers of each lifecycle manager, in the order of their bring-up."""


class LifecycleState(IntEnum):
    """Values of lifecycle_msgs/State."""

    UNCONFIGURED = 1
    INACTIVE = 2
    ACTIVE = 3
    FINALIZED = 4


class Transition(IntEnum):
    """Values of lifecycle_msgs/Transition."""

    CONFIGURE = 1
    CLEANUP = 2
    ACTIVATE = 3
    DEACTIVATE = 4
    SHUTDOWN = 5


class Command(IntEnum):
    """nav2_msgs/ManageLifecycleNodes: what a client has a lifecycle manager do with its group."""

    STARTUP = 0
    PAUSE = 1
    RESUME = 2
    RESET = 3
    SHUTDOWN = 4


_STEPS: Mapping[Transition, tuple[LifecycleState, LifecycleState]] = {
    Transition.CONFIGURE: (LifecycleState.UNCONFIGURED, LifecycleState.INACTIVE),
    Transition.CLEANUP: (LifecycleState.INACTIVE, LifecycleState.UNCONFIGURED),
    Transition.ACTIVATE: (LifecycleState.INACTIVE, LifecycleState.ACTIVE),
    Transition.DEACTIVATE: (LifecycleState.ACTIVE, LifecycleState.INACTIVE),
    Transition.SHUTDOWN: (LifecycleState.UNCONFIGURED, LifecycleState.FINALIZED),
}
"""State before and after each transition."""
_COMMANDS: Mapping[int, tuple[Transition, ...]] = {
    Command.STARTUP: (Transition.CONFIGURE, Transition.ACTIVATE),
    Command.PAUSE: (Transition.DEACTIVATE,),
    Command.RESUME: (Transition.ACTIVATE,),
    Command.RESET: (Transition.DEACTIVATE, Transition.CLEANUP),
    Command.SHUTDOWN: (Transition.DEACTIVATE, Transition.CLEANUP, Transition.SHUTDOWN),
}
"""The transitions of all servers that a command consists of."""
_FORWARD = frozenset({Transition.CONFIGURE, Transition.ACTIVATE})
"""Transitions in the order of the group; others are in reverse order."""
STOPPING = frozenset({Command.PAUSE, Command.RESET, Command.SHUTDOWN})
"""Commands that end the goals, and after which a lifecycle manager watches no bonds."""


@dataclass(frozen=True, slots=True)
class Change:
    """A transition that a server has made."""

    server: Server
    transition: int
    before: LifecycleState
    after: LifecycleState


@dataclass(slots=True)
class _Watch:
    """What a lifecycle manager notes of its group; times are monotonic seconds."""

    missed_since: float | None = None
    """When the heartbeat of a server stopped."""
    reset_at: float | None = None
    """When it deactivated the group; None: it watches its bonds."""
    complete: bool = False
    """Whether all servers were deactivated, so that they are to be cleaned up."""
    checked_at: float = 0.0
    idle: bool = False
    """Whether it watches nothing: it has given up, or a client has stopped the group."""


class Servers:
    """The state of each process; times are monotonic seconds."""

    def __init__(self) -> None:
        self._dead: set[Server] = set()
        self._listed_until: dict[Server, float] = {}
        self._hung: set[Server] = set()
        self._unbound: set[Server] = set()
        self._states = dict.fromkeys(Server, LifecycleState.ACTIVE)
        self._watches = {manager: _Watch() for manager in MANAGED}
        self._changes: list[Change] = []

    def there(self, server: Server) -> bool:
        """Return whether the process is in the ROS graph."""
        return server not in self._dead

    def listed(self, server: Server) -> bool:
        """Return whether the process has died and its endpoints are still in the ROS graph."""
        return server in self._listed_until

    def configured(self, server: Server) -> bool:
        """Return whether the process is in the ROS graph with the endpoints of its work."""
        configured = (LifecycleState.INACTIVE, LifecycleState.ACTIVE)
        return self.there(server) and self._states[server] in configured

    def runs(self, server: Server) -> bool:
        """Return whether the process answers; it works if it is active as well."""
        return self.there(server) and server not in self._hung

    def state(self, server: Server) -> LifecycleState:
        """Return the lifecycle state of a server."""
        return self._states[server]

    def works(self, server: Server) -> bool:
        """Return whether the process runs and is active."""
        return self.runs(server) and self._states[server] is LifecycleState.ACTIVE

    def group_active(self, manager: Server) -> bool:
        """Return whether a lifecycle manager considers its group active; bonds notice a dead server later."""
        watch = self._watches[manager]
        held = (
            self._states[server] is LifecycleState.ACTIVE or server in self._unbound
            for server in MANAGED[manager]
        )
        return watch.reset_at is None and not watch.idle and all(held)

    def set_dead(self, server: Server, *, dead: bool, listed_until: float = 0.0) -> None:
        """Make a process die, or restart it: unconfigured, and without a bond to its lifecycle manager.

        A process that dies stays :meth:`listed` until a time.
        """
        self._listed_until.pop(server, None)
        if not dead:
            self._dead.discard(server)
            return
        self._dead.add(server)
        self._hung.discard(server)
        if listed_until:
            self._listed_until[server] = listed_until
        if server in MANAGED:
            self._watches[server] = _Watch()
        else:
            self._unbound.add(server)
            self._states[server] = LifecycleState.UNCONFIGURED

    def set_hung(self, server: Server, *, hung: bool) -> None:
        """Make a process hang, or continue."""
        (self._hung.add if hung else self._hung.discard)(server)

    def set_state(self, server: Server, state: LifecycleState) -> None:
        """Set the lifecycle state of a server."""
        self._states[server] = state

    def set_group(self, manager: Server, state: LifecycleState) -> None:
        """Set all servers of a lifecycle manager to a state, but those that have died."""
        for server in MANAGED[manager]:
            if server not in self._unbound:
                self._states[server] = state

    def change(self, server: Server, transition: int) -> bool:
        """Execute a transition; return False if the server's state does not allow it."""
        steps = (step for each, step in _STEPS.items() if each == transition)
        before, after = next(steps, (None, None))
        if before is None or after is None or self._states[server] is not before:
            return False
        self._states[server] = after
        # The lifecycle manager makes its bond with a server when it activates it.
        if after is LifecycleState.ACTIVE:
            self._unbound.discard(server)
        self._changes.append(Change(server, transition, before, after))
        return True

    def take_changes(self) -> list[Change]:
        """Return the transitions since the last call."""
        changes, self._changes = self._changes, []
        return changes

    def manage(self, manager: Server, command: int) -> bool:
        """Execute a client's command to a lifecycle manager; return whether all servers have done it.

        As in Nav2, it stops at the first server that does not, also where that has been done before.
        """
        transitions = _COMMANDS.get(command, ())
        done = bool(transitions)
        for transition in transitions:
            if done or command == Command.SHUTDOWN:  # which always succeeds
                done = self._change_all(manager, transition)
        succeeded = done or command == Command.SHUTDOWN
        self._watches[manager] = _Watch(idle=not succeeded or command in STOPPING)
        return succeeded

    def _change_all(self, manager: Server, transition: Transition) -> bool:
        group = MANAGED[manager]
        order = group if transition in _FORWARD else reversed(group)
        return all(self.runs(server) and self.change(server, transition) for server in order)

    def advance(self, now: float) -> bool:
        """Run the lifecycle managers' checks; return whether a state or the ROS graph has changed."""
        left = [server for server, end in self._listed_until.items() if now >= end]
        for server in left:
            del self._listed_until[server]
        before = len(self._changes)
        for manager, watch in self._watches.items():
            if self.runs(manager) and not watch.idle:
                self._check_bonds(manager, watch, now)
        return bool(left) or len(self._changes) > before

    def _check_bonds(self, manager: Server, watch: _Watch, now: float) -> None:
        group = MANAGED[manager]
        running = all(map(self.runs, group))
        if watch.reset_at is None:
            missing = not running or not self._unbound.isdisjoint(group)
            watch.missed_since = (watch.missed_since or now) if missing else None
            if watch.missed_since is not None and now - watch.missed_since >= BOND_TIMEOUT:
                watch.reset_at = watch.checked_at = now
                watch.complete = self._deactivate_group(manager)
        elif watch.complete and now - watch.reset_at >= CLEANING:
            watch.complete = False
            for server in reversed(group):
                self.change(server, Transition.CLEANUP)
        elif now - watch.checked_at >= RESPAWN_CHECK:
            watch.checked_at = now
            if running and any(self._states[server] is LifecycleState.ACTIVE for server in group):
                watch.reset_at, watch.complete = now, self._deactivate_group(manager)  # the rest of the reset
            elif running:
                self._bring_up(manager)
            elif not all(map(self.there, group)):
                watch.idle = now - watch.reset_at >= RESPAWN_WAIT

    def _deactivate_group(self, manager: Server) -> bool:
        """Deactivate the active ones up to the first one without an answer; return whether all answer."""
        for server in reversed(MANAGED[manager]):
            if not self.runs(server):
                # Measured: the manager hangs in deactivating a killed node, also after that has returned.
                if self.listed(server):
                    self._hung.add(manager)
                return False
            self.change(server, Transition.DEACTIVATE)
        return True

    def _bring_up(self, manager: Server) -> None:
        for transition in (Transition.CONFIGURE, Transition.ACTIVATE):
            for server in MANAGED[manager]:
                self.change(server, transition)
        self._watches[manager] = _Watch()


Value = bool | int | float | str | list[str]


def parameters(
    *,
    xy_tolerance: float,
    yaw_tolerance: float,
    planner_tolerance: float,
    speed: float,
    approach: float,
    server_timeout: float,
) -> dict[Server, dict[str, Value]]:
    """Return the parameters that Nav2's servers would have: m, rad, m/s, s."""
    return {
        Server.CONTROLLER: {
            "controller_frequency": 20.0,
            "controller_plugins": ["FollowPath"],
            "FollowPath.plugin": "nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController",
            "FollowPath.desired_linear_vel": speed,
            "FollowPath.approach_velocity_scaling_dist": approach,
            "goal_checker_plugins": ["general_goal_checker"],
            "general_goal_checker.plugin": "nav2_controller::SimpleGoalChecker",
            "general_goal_checker.xy_goal_tolerance": xy_tolerance,
            "general_goal_checker.yaw_goal_tolerance": yaw_tolerance,
        },
        Server.PLANNER: {
            "planner_plugins": ["GridBased"],
            "GridBased.plugin": "nav2_navfn_planner::NavfnPlanner",
            "GridBased.tolerance": planner_tolerance,
        },
        Server.NAVIGATOR: {
            "default_server_timeout": round(1000 * server_timeout),
            "bt_loop_duration": 10,
            "global_frame": "map",
            "robot_base_frame": "base_link",
        },
    }
