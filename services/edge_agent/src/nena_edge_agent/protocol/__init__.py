"""The robot's side of VDA 5050: a pure core that turns events into effects and a new state.

It uses version-neutral messages, and has no I/O, clock, threads or ROS. One :class:`RobotState` holds all
state; the modules ``orders``, ``driving``, ``actions``, ``instant_actions`` and ``zones`` are functions that
change it. Section numbers refer to VDA 5050 3.0.0 unless stated otherwise.
"""

from nena_edge_agent.protocol.robot import RobotCore

__all__ = ["RobotCore"]
