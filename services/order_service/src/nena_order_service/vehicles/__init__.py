"""Vehicles: who they are, where they are, what they do without an order."""
