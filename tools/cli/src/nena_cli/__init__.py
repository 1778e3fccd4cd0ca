"""The command line of NeNa."""
