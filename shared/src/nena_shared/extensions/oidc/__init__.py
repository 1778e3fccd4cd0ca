"""Users of an OpenID Connect issuer, in addition to NeNa's own users.

The libraries are in the extra ``oidc``; access control loads it by its entry point if ``http.oidc`` is set.
"""
