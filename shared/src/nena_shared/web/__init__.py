"""Common parts of NeNa's HTTP services: listening, access, problems.

Needs the extra ``web`` of this distribution; robots go without it.
"""
