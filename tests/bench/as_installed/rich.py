"""Hides the package of this name, which the tools of developers and other services bring: no robot has it."""

message = "not on a robot"
raise ImportError(message)
