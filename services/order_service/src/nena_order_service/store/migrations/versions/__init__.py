"""One migration per module."""
