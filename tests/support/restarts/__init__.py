"""A robot whose agent is cut off at any moment, in a time of its own; what survives, and what must hold."""
