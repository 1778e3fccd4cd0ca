"""Why somebody with a token of the issuer is not let in."""

from __future__ import annotations


class TokenRefusedError(Exception):
    """The token does not count; the text says why: "it has expired"."""


class NoRoleError(Exception):
    """The token is good, but its owner has no role here; the text says what to do."""


class IssuerAwayError(Exception):
    """The issuer cannot be asked, so nothing can be said of its tokens; the text says what happened."""
