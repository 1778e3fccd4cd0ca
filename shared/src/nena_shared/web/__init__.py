"""What NeNa's HTTP services have in common: where they listen, who may do what, how errors are told.

Needs the extra ``web`` of this distribution; robots go without it.
"""
