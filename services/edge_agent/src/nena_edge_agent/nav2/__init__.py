"""The driver for Nav2: goals, localisation, the ROS session, and what it hears from the robot."""
