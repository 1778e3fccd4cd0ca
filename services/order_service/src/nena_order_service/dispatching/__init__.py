"""Dispatching: which order is given to which vehicle."""
