"""The host side of the order service: REST, MQTT, the event stream and openTCS's paths.

:mod:`operations` executes the requests; the table of operations is :mod:`nena_shared.fleet_api.operations`.
"""
