"""Transport orders: their life cycle, and the validation of requests against the plant."""
