"""Prometheus metrics; ``docs/metrics.md`` lists all of them.

Fleet metrics are few and use prometheus_client (``exposition``). Metrics of single robots are tens of
thousands of lines and are written directly (``robot_series``): an object per line takes ten times as long
and would block the event loop.
"""
