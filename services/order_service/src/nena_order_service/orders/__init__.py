"""Transport orders: what becomes of them, and whether a request for one makes sense in the plant."""
