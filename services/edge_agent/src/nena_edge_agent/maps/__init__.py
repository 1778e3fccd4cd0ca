"""Maps on the robot: what fleet control brings, enables and deletes (section 6.3)."""
