"""Nav2's action types, made from definitions of our own where no ROS installation brings them."""
