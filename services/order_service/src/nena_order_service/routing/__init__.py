"""Routes over the plant model."""
