"""What hosts reach of the order service: REST, MQTT, the event stream and openTCS's paths.

:mod:`operations` does what hosts ask for; the table of what they may ask for is
:mod:`nena_shared.fleet_api.operations`.
"""
