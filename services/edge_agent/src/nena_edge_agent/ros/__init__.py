"""The driver for Nav2 by its topics. Nothing here loads rclpy before the driver is started."""
