"""NeNa demo: starts the whole stack on one machine and runs the main job."""
