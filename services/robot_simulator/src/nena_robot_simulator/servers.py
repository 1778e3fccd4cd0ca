"""The processes of Nav2: which of them run, their lifecycle states, and their parameters.

Each can die or hang alone, as in a Nav2 that is not composed. A lifecycle manager notices this by its bond
and deactivates all servers of its group; it activates them again when the missing one is back.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum, StrEnum

BOND_TIMEOUT = 4.0
"""Seconds without a server's heartbeat after which its lifecycle manager deactivates the group."""


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
    Server.MANAGER: (Server.NAVIGATOR, Server.CONTROLLER, Server.PLANNER, Server.BEHAVIOURS),
    Server.LOCALISATION_MANAGER: (Server.LOCALISATION, Server.MAPS),
}
"""The servers of each lifecycle manager."""


class LifecycleState(IntEnum):
    """Values of lifecycle_msgs/State."""

    UNCONFIGURED = 1
    INACTIVE = 2
    ACTIVE = 3


class Transition(IntEnum):
    """Values of lifecycle_msgs/Transition."""

    CONFIGURE = 1
    CLEANUP = 2
    ACTIVATE = 3
    DEACTIVATE = 4


_STEPS: Mapping[Transition, tuple[LifecycleState, LifecycleState]] = {
    Transition.CONFIGURE: (LifecycleState.UNCONFIGURED, LifecycleState.INACTIVE),
    Transition.CLEANUP: (LifecycleState.INACTIVE, LifecycleState.UNCONFIGURED),
    Transition.ACTIVATE: (LifecycleState.INACTIVE, LifecycleState.ACTIVE),
    Transition.DEACTIVATE: (LifecycleState.ACTIVE, LifecycleState.INACTIVE),
}
"""State before and after each transition."""


class Servers:
    """The state of each process; times are monotonic seconds."""

    def __init__(self) -> None:
        self._dead: set[Server] = set()
        self._hung: set[Server] = set()
        self._states = dict.fromkeys(Server, LifecycleState.ACTIVE)
        self._missing_since: dict[Server, float] = {}
        self._broken: set[Server] = set()

    def there(self, server: Server) -> bool:
        """Return whether the process is in the ROS graph."""
        return server not in self._dead

    def runs(self, server: Server) -> bool:
        """Return whether the process works and answers."""
        return self.there(server) and server not in self._hung

    def state(self, server: Server) -> LifecycleState:
        """Return the lifecycle state of a server."""
        return self._states[server]

    def works(self, server: Server) -> bool:
        """Return whether the process runs and is active."""
        return self.runs(server) and self._states[server] is LifecycleState.ACTIVE

    def group_active(self, manager: Server) -> bool:
        """Return whether a lifecycle manager considers its group active; bonds notice a dead server later."""
        active = (self._states[server] is LifecycleState.ACTIVE for server in MANAGED[manager])
        return manager not in self._broken and all(active)

    def set_dead(self, server: Server, *, dead: bool) -> None:
        """Make a process die, or restart it."""
        (self._dead.add if dead else self._dead.discard)(server)

    def set_hung(self, server: Server, *, hung: bool) -> None:
        """Make a process hang, or continue."""
        (self._hung.add if hung else self._hung.discard)(server)

    def set_state(self, server: Server, state: LifecycleState) -> None:
        """Set the lifecycle state of a server."""
        self._states[server] = state

    def set_group(self, manager: Server, state: LifecycleState) -> None:
        """Set all servers of a lifecycle manager to a state."""
        for server in MANAGED[manager]:
            self._states[server] = state

    def change(self, server: Server, transition: int) -> bool:
        """Execute a transition; return False if the server's state does not allow it."""
        steps = (step for each, step in _STEPS.items() if each == transition)
        before, after = next(steps, (None, None))
        if after is None or self._states[server] is not before:
            return False
        self._states[server] = after
        return True

    def advance(self, now: float) -> bool:
        """Run the lifecycle managers' bond checks; return whether any state changed."""
        changed = False
        for manager, group in MANAGED.items():
            missing = self.runs(manager) and not all(map(self.runs, group))
            since = self._missing_since.setdefault(manager, now) if missing else None
            if since is None:
                self._missing_since.pop(manager, None)
            if since is not None and now - since >= BOND_TIMEOUT and manager not in self._broken:
                self._broken.add(manager)
                self.set_group(manager, LifecycleState.INACTIVE)
                changed = True
            elif manager in self._broken and all(map(self.runs, group)):
                self._broken.discard(manager)
                self.set_group(manager, LifecycleState.ACTIVE)
                changed = True
        return changed


Value = bool | int | float | str | list[str]


def parameters(
    *, xy_tolerance: float, yaw_tolerance: float, planner_tolerance: float, speed: float, approach: float
) -> dict[Server, dict[str, Value]]:
    """Return the parameters that Nav2's servers would have: m, rad, m/s."""
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
            "default_server_timeout": 20,
            "bt_loop_duration": 10,
            "global_frame": "map",
            "robot_base_frame": "base_link",
        },
    }
