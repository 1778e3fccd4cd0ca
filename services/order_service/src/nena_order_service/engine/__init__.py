"""The engine: one state, and the flows that change it in units of work."""
