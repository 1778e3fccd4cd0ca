"""The fleet as VDA 5050 traffic and the order service tell it: pure, without I/O and without a clock.

Messages and the time go in (class ``FleetModel``), views of robots and orders and their changes come out. The
same messages at the same times always give the same views, so that a recorded conversation can be replayed.
"""
