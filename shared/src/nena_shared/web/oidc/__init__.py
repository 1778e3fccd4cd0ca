"""People and programs that an OpenID Connect issuer vouches for, beside NeNa's own users.

Optional: the libraries are in the extra ``oidc`` of this distribution, and only
:func:`.enabled.access_tokens_of` loads the modules that need them.
"""
