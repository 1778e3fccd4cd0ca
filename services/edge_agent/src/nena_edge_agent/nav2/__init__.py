"""The driver for Nav2: goals, localisation, the ROS session, and what the robot publishes."""
