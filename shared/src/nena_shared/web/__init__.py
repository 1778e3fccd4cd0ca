"""Common parts of NeNa's HTTP services: server, access control, problem details.

Needs the extra ``web`` of this distribution, which robots do not install.
"""
