"""Loopback robots: simulated robots that exist only in this program, for tests and load tests."""
