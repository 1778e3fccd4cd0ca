"""A simulated fleet for traffic control: random plants, events, an independent look for collisions."""
