"""Drivers: what moves a robot, behind one port."""
