"""A robot whose agent is killed at any moment, in virtual time; what survives, and what must hold."""
