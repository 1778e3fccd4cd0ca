"""One step of the tables in each module."""
