"""Peripheral devices, such as doors and lifts: their jobs, and which part of a route needs them."""
