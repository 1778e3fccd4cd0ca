"""Vehicles: their names and robots, their positions, and what they do without an order."""
