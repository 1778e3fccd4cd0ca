"""The port between the protocol core and the drivers, in the plant's frame or in that of the robot's map."""
