"""The host side of the order service: REST, MQTT, the event stream and openTCS's paths.

:mod:`operations` executes the requests by the file of each noun (:mod:`orders`, :mod:`vehicles`, ...); the
table of operations is :mod:`nena_shared.fleet_api.operations`.
"""
