"""The loopback driver: a robot that exists in this program only, for tests, load tests and simulation."""
