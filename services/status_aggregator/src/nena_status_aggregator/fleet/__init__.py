"""The fleet model, built from VDA 5050 messages and the order service's statuses. Pure: no I/O, no clock.

``FleetModel`` receives messages with their time of arrival, and returns views of robots and orders and their
changes. The same messages at the same times lead to the same views, so that a recorded conversation can be
replayed.
"""
