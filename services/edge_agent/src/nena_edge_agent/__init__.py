"""NeNa edge agent: VDA 5050 on one side, ROS 2 Nav2 on the other."""
