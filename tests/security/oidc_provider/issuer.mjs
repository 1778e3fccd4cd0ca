// An OpenID Connect issuer on loopback: oidc-provider with its own development pages, on which anybody signs in.
// node issuer.mjs PORT PANEL ALGORITHM: writes "ready" once it listens.
import { generateKeyPairSync } from "node:crypto";
import { Provider } from "oidc-provider";

const [port, panel, algorithm] = process.argv.slice(2);
const API = "urn:nena:fleet";
const ROLES = { ann: ["nena-operator"], vic: ["nena-viewer"], bob: ["cook"] };

const pair = algorithm === "ES256"
  ? generateKeyPairSync("ec", { namedCurve: "P-256" })
  : generateKeyPairSync("rsa", { modulusLength: 2048 });
const key = { ...pair.privateKey.export({ format: "jwk" }), kid: "one", alg: algorithm, use: "sig" };

const provider = new Provider(`http://127.0.0.1:${port}`, {
  jwks: { keys: [key] },
  clients: [{
    client_id: "nena-panel",
    client_secret: "panel-secret",
    redirect_uris: [`${panel}api/v1/session/oidc/callback`],
    id_token_signed_response_alg: algorithm,
  }],
  cookies: { keys: ["of the test"] },
  pkce: { required: () => true },
  findAccount: (_, id) => ({ accountId: id, claims: () => ({ sub: id, preferred_username: id }) }),
  extraTokenClaims: (_, token) => ({ roles: ROLES[token.accountId] ?? [], preferred_username: token.accountId }),
  features: {
    devInteractions: { enabled: true },
    resourceIndicators: {
      enabled: true,
      defaultResource: () => API,
      useGrantedResource: () => true,
      getResourceServerInfo: () => ({
        scope: "openid profile",
        audience: "nena",
        accessTokenTTL: 300,
        accessTokenFormat: "jwt",
        jwt: { sign: { alg: algorithm } },
      }),
    },
  },
});
provider.listen(Number(port), "127.0.0.1", () => console.log("ready"));
