"""The port between the protocol core and the drivers, and its frames."""
