"""Dispatching: which vehicle does which transport order, and in words why not."""
