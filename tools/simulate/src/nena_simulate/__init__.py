"""Simulation of a site in accelerated time: the real order service and edge agents, one clock, no broker."""
