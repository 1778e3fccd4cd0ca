"""NeNa robot simulator: a ROS 2 node that behaves as Nav2 does on its topics."""
