"""An OpenID Connect issuer on loopback, with real keys, real signatures and all its endpoints.

It replaces Keycloak, Authentik, Dex, Entra ID and the like, which are not available where these tests run. It
is as strict as they are about the panel's requests: redirect_uri, PKCE, the client's password, used codes.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import html
import json
import secrets
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Event, Thread
from typing import Any
from urllib.parse import parse_qs, parse_qsl, unquote, urlencode, urlsplit

import jwt
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec, rsa
from jwt.algorithms import ECAlgorithm, RSAAlgorithm

from support.waiting import PATIENCE

AUDIENCE = "nena"
CLIENT = "nena-panel"
LIFE = 300
"""Seconds that tokens are good for."""
DISCOVERY = "/.well-known/openid-configuration"
KEYS = "/keys"
TOKEN = "/token"
PAGE = "<!doctype html><title>Issuer</title><link rel='icon' href='data:,'><h1>Who are you?</h1>"


@dataclass(frozen=True)
class SigningKey:
    """A key of the issuer."""

    kid: str
    algorithm: str
    private: rsa.RSAPrivateKey | ec.EllipticCurvePrivateKey

    @property
    def public(self) -> dict[str, Any]:
        """Return it as in the JWK Set."""
        key = self.private.public_key()
        made = RSAAlgorithm.to_jwk(key) if isinstance(key, rsa.RSAPublicKey) else ECAlgorithm.to_jwk(key)
        return {**json.loads(made), "kid": self.kid, "alg": self.algorithm, "use": "sig"}

    @property
    def public_pem(self) -> bytes:
        """As a file, which everybody may have."""
        form = serialization.PublicFormat.SubjectPublicKeyInfo
        return self.private.public_key().public_bytes(serialization.Encoding.PEM, form)


@cache
def rsa_key() -> SigningKey:
    """Return the RSA key of all tests: making one takes a while."""
    return SigningKey("rsa-1", "RS256", rsa.generate_private_key(65537, 2048))


def ec_key(kid: str = "ec-1") -> SigningKey:
    """Make a key on P-256."""
    return SigningKey(kid, "ES256", ec.generate_private_key(ec.SECP256R1()))


@dataclass
class OidcIssuer:
    """The issuer's state, its answers, and the requests received."""

    address: str
    keys: list[SigningKey] = field(default_factory=lambda: [rsa_key()])
    """The first one signs."""
    people: dict[str, list[str]] = field(
        default_factory=lambda: {"ann": ["nena-operator"], "vic": ["nena-viewer"], "bob": ["cook"]}
    )
    """Roles by name."""
    redirect_uri: str = ""
    """The only one that is registered."""
    client_secret: str | None = None
    metadata: dict[str, Any] = field(default_factory=dict)
    """Said in the description instead of what is so."""
    access_claims: dict[str, Any] = field(default_factory=dict)
    id_claims: dict[str, Any] = field(default_factory=dict)
    """Said in tokens instead of what is so."""
    broken: dict[str, bytes] = field(default_factory=dict)
    """Answers of paths instead of what is so."""
    moved: dict[str, str] = field(default_factory=dict)
    """Where else paths are, as their answers say."""
    silent: set[str] = field(default_factory=set)
    """Paths at which nothing is answered until the end."""
    asked: Counter[str] = field(default_factory=Counter)
    """Requests, by path."""
    codes: dict[str, dict[str, str]] = field(default_factory=dict)
    """What was asked for, by codes that have not been used."""
    closing: Event = field(default_factory=Event)

    def register(self, panel: str) -> None:
        """Register the panel at this address as the only client."""
        self.redirect_uri = f"{panel}api/v1/session/oidc/callback"

    def settings_of(self, panel: str) -> dict[str, str]:
        """Return the settings ``http.oidc`` of the aggregator of this panel."""
        return {"issuer": self.address, "audience": AUDIENCE, "client_id": CLIENT, "panel_url": panel}

    def token(self, name: str = "ann", key: SigningKey | None = None, **claims: Any) -> str:
        """Make an access token; a claim that is None is left out."""
        now = int(time.time())
        said = {
            "iss": self.address,
            "aud": AUDIENCE,
            "sub": f"id-of-{name}",
            "preferred_username": name,
            "roles": self.people.get(name, []),
            "iat": now,
            "exp": now + LIFE,
            **self.access_claims,
            **claims,
        }
        return signed({k: v for k, v in said.items() if v is not None}, key or self.keys[0])

    def description(self) -> dict[str, Any]:
        return {
            "issuer": self.address,
            "authorization_endpoint": f"{self.address}/authorize",
            "token_endpoint": f"{self.address}{TOKEN}",
            "jwks_uri": f"{self.address}{KEYS}",
            **self.metadata,
        }

    def authorize(self, query: dict[str, str]) -> tuple[int, str, str]:
        """Return status, address to go on to, and page."""
        if query.get("redirect_uri") != self.redirect_uri or query.get("client_id") != CLIENT:
            return 400, "", "unknown client or redirect_uri"
        name = query.pop("person", None)
        if name is None:
            links = (
                f"<p><a href='?{html.escape(urlencode({**query, 'person': each}))}'>{each}</a></p>"
                for each in self.people
            )
            return 200, "", f"{PAGE}{''.join(links)}"
        if name not in self.people:
            return (
                302,
                f"{self.redirect_uri}?{urlencode({'error': 'access_denied', 'state': query['state']})}",
                "",
            )
        code = secrets.token_urlsafe()
        self.codes[code] = {**query, "person": name}
        return 302, f"{self.redirect_uri}?{urlencode({'code': code, 'state': query['state']})}", ""

    def exchange(self, form: dict[str, str], login: str) -> tuple[int, dict[str, Any]]:
        """Return status and answer of the token endpoint."""
        if not self._is_client(form, login):
            return 401, {"error": "invalid_client"}
        asked = self.codes.pop(form.get("code", ""), None)
        digest = hashlib.sha256(form.get("code_verifier", "").encode()).digest()
        challenge = base64.urlsafe_b64encode(digest).rstrip(b"=").decode()
        right = asked and challenge == asked["code_challenge"] and asked["code_challenge_method"] == "S256"
        if asked is None or not right or form.get("redirect_uri") != self.redirect_uri:
            return 400, {"error": "invalid_grant"}
        name, now = asked["person"], int(time.time())
        identity = {
            "iss": self.address,
            "aud": CLIENT,
            "sub": f"id-of-{name}",
            "nonce": asked["nonce"],
            "iat": now,
            "exp": now + LIFE,
            **self.id_claims,
        }
        id_token = signed({k: v for k, v in identity.items() if v is not None}, self.keys[0])
        return 200, {"access_token": self.token(name), "id_token": id_token, "token_type": "Bearer"}

    def _is_client(self, form: dict[str, str], login: str) -> bool:
        if self.client_secret is None:
            return form.get("client_id") == CLIENT
        given = f"{form.get('client_id')}:{form.get('client_secret')}"
        if login.startswith("Basic "):
            given = unquote(base64.b64decode(login.removeprefix("Basic ")).decode())
        return given == f"{CLIENT}:{self.client_secret}"


def signed(claims: dict[str, Any], key: SigningKey, **header: Any) -> str:
    """Sign claims as ``key`` does."""
    return jwt.encode(claims, key.private, key.algorithm, headers={"kid": key.kid, **header})


def signed_by_secret(claims: dict[str, Any], secret: bytes, header: dict[str, Any]) -> str:
    """Sign with HMAC by hand: libraries refuse a public key as the secret."""
    first = f"{_part(header)}.{_part(claims)}"
    seal = hmac.digest(secret, first.encode(), "sha256")
    return f"{first}.{base64.urlsafe_b64encode(seal).rstrip(b'=').decode()}"


def unsigned(claims: dict[str, Any], header: dict[str, Any]) -> str:
    """Make a token without a signature."""
    return f"{_part(header)}.{_part(claims)}."


def _part(value: dict[str, Any]) -> str:
    return base64.urlsafe_b64encode(json.dumps(value).encode()).rstrip(b"=").decode()


@contextmanager
def oidc_issuer() -> Iterator[OidcIssuer]:
    """Serve an issuer until the block ends.

    Its name is localhost, and that of the services 127.0.0.1: to a browser these are two sites.
    """
    server = _Server()
    issuer = server.issuer
    thread = Thread(target=server.serve_forever, args=(0.05,), name="issuer", daemon=True)
    thread.start()
    try:
        yield issuer
    finally:
        issuer.closing.set()
        server.shutdown()
        server.server_close()
        thread.join(PATIENCE)


class _Server(ThreadingHTTPServer):
    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.issuer = OidcIssuer(f"http://localhost:{self.server_address[1]}")


class _Handler(BaseHTTPRequestHandler):
    server: _Server

    @property
    def issuer(self) -> OidcIssuer:
        return self.server.issuer

    def do_GET(self) -> None:
        address = urlsplit(self.path)
        if self._is_out_of_order(address.path):
            return
        if address.path == DISCOVERY:
            self._json(200, self.issuer.description())
        elif address.path == KEYS:
            self._json(200, {"keys": [each.public for each in self.issuer.keys]})
        elif address.path == "/authorize":
            status, where, page = self.issuer.authorize(dict(parse_qsl(address.query)))
            self._send(status, page.encode(), "text/html", where)
        else:
            self._json(404, {"error": "not_found"})

    def do_POST(self) -> None:
        if self._is_out_of_order(self.path):
            return
        body = self.rfile.read(int(self.headers["Content-Length"])).decode()
        form = {name: values[0] for name, values in parse_qs(body).items()}
        self._json(*self.issuer.exchange(form, self.headers.get("Authorization", "")))

    def _is_out_of_order(self, path: str) -> bool:
        self.issuer.asked[path] += 1
        if path in self.issuer.silent:
            self.issuer.closing.wait(PATIENCE)
            return True
        if path in self.issuer.moved:
            self._send(302, b"", "text/plain", self.issuer.moved[path])
            return True
        if path in self.issuer.broken:
            self._send(200, self.issuer.broken[path], "application/json")
            return True
        return False

    def _json(self, status: int, answer: dict[str, Any]) -> None:
        self._send(status, json.dumps(answer).encode(), "application/json")

    def _send(self, status: int, body: bytes, kind: str, where: str = "") -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        if where:
            self.send_header("Location", where)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Log nothing."""
