"""The mobile robot's side of VDA 5050, pure: events and the time go in, effects and a new state come out.

Everything here works on the version-neutral messages; no I/O, no clock, no threads. Section numbers are those
of VDA 5050 3.0.0 unless it says otherwise.
"""

from nena_edge_agent.protocol.robot import RobotCore

__all__ = ["RobotCore"]
