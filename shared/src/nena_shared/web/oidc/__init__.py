"""Users of an OpenID Connect issuer, in addition to NeNa's own users.

Optional: the libraries are in the extra ``oidc`` of this distribution, and only
:func:`nena_shared.web.access.access_tokens_of` imports the modules that need them.
"""
