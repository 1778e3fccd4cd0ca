"""What Prometheus is told; ``docs/metrics.md`` lists every metric.

Figures of the fleet as a whole are few and go through prometheus_client (``fleet_collector``). Those of
single robots are tens of thousands of lines and are written here (``robot_series``), because making an object
of each line takes ten times as long as writing it, and the event loop would stand still meanwhile.
"""
