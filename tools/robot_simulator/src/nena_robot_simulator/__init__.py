"""NeNa robot simulator: a ROS 2 node that behaves like Nav2 on its topics."""
