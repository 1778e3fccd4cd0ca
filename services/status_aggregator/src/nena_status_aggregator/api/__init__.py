"""HTTP: the fleet as resources, the stream of changes, health, metrics and the page."""
