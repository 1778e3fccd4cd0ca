"""What an address says of who reaches it."""

from __future__ import annotations

from ipaddress import IPv4Address, ip_address, ip_network

OF_ONE_SITE = 64
"""Bits of an IPv6 address that lead to one site; the rest one machine may choose."""


def is_loopback(host: str) -> bool:
    """Return whether only this machine reaches ``host``; a name other than localhost may lead anywhere."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def network_of(address: str) -> str:
    """Return what counts as one client's address: an IPv4 address, or the /64 network of an IPv6 address."""
    try:
        known = ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(known, IPv4Address):
        return str(known)
    return str(known.ipv4_mapped or ip_network((known, OF_ONE_SITE), strict=False))
