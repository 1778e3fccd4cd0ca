"""Certificates, the broker's access list and users of a NeNa site."""
