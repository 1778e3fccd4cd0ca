"""What happened to robots and orders, kept in a database for a set time.

Happenings go through a bounded queue (``writer``) into one table (``schema``, ``database``), written in
batches by a thread of its own, so that a slow or missing database never holds the event loop.
"""
