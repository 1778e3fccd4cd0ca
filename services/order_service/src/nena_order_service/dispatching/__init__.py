"""Dispatching: which vehicle gets which order."""
