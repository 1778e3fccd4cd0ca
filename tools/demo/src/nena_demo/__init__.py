"""NeNa demo: starts the whole stack on one machine, for a guided tour or a smoke test."""
