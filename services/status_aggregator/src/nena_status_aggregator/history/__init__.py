"""The history: events of robots and orders, kept in a database for a configured time.

Events pass a bounded queue (``writer``) into one table (``database``). A separate thread writes them in
batches, so a slow or unavailable database never blocks the event loop.
"""
