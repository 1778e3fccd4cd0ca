"""Mosquitto's configuration for a site: TLS, a certificate of each client, and the access list."""

from __future__ import annotations

from pathlib import PurePosixPath

TEMPLATE = """\
# Made by nena-deploy. Clients are known by their certificates; what each may do is in access.list.
listener {port}
cafile {folder}/ca.pem
certfile {folder}/broker.pem
keyfile {folder}/broker-key.pem
crlfile {folder}/revoked.pem
tls_version tlsv1.2
require_certificate true
use_identity_as_username true
allow_anonymous false
acl_file {folder}/access.list

# What one client may cost the others. The longest message is the model of a large plant.
max_packet_size 67108864
max_inflight_messages 200
max_queued_messages 10000
max_connections 5000
max_keepalive 120
set_tcp_nodelay true

persistence true
persistence_location {data}/
autosave_interval 30
log_dest stdout
"""


def broker_configuration(folder: PurePosixPath, data: PurePosixPath, port: int) -> str:
    """Write the configuration; ``folder``: where the broker finds its files, ``data``: where it writes."""
    return TEMPLATE.format(folder=folder, data=data, port=port)
