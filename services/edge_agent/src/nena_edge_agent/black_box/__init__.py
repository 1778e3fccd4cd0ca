"""The black box of a robot: what starts a recording, what is recorded, and the action that requests one."""
