"""NeNa status aggregator: fleet state, Prometheus metrics and control panel."""
