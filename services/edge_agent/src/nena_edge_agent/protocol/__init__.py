"""The mobile robot's side of VDA 5050: its input is events and the time, its output effects and a new state.

Everything here is pure and works on version-neutral messages: no I/O, no clock, no threads, no ROS. One
:class:`RobotState` holds everything; the modules ``orders``, ``driving``, ``actions``, ``instant_actions``
and ``zones`` are functions that change it. Section numbers are those of VDA 5050 3.0.0 unless stated
otherwise.
"""

from nena_edge_agent.protocol.robot import RobotCore

__all__ = ["RobotCore"]
