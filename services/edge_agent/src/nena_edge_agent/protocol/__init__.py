"""The robot's side of VDA 5050: a pure core that turns events into effects and a new state.

It uses version-neutral messages, and has no I/O, clock, threads or ROS. ``robot.RobotCore`` handles events;
``robot_state.RobotState`` is all its state. The functions in ``orders``,
``driving``, ``actions``, ``instant_actions``, ``power`` and ``zones`` change that state. Section numbers
refer to VDA 5050 3.0.0 unless stated otherwise.
"""
