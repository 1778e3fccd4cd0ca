"""Conversations of VDA 5050 robots and fleet controls: recorded, replayed, shown and checked."""
