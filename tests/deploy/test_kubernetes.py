"""The manifests fit Kubernetes' schemas, the images, the programs' settings, and each other."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import urlsplit

import kubernetes_validate  # type: ignore[import-untyped]  # it has no types
import pytest
import yaml  # type: ignore[import-untyped]  # its stubs would be one more dependency

from nena_order_service import extension as order_service
from nena_order_service.settings import OrderServiceSettings
from nena_shared.fleet_api.base import Role
from nena_shared.settings import ServiceSettings, load, settings_with
from nena_shared.web.settings import check_exposure
from nena_status_aggregator import extension as aggregator
from nena_status_aggregator.api.session import make_rule
from nena_status_aggregator.settings import AggregatorSettings, Share

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "deploy" / "kubernetes"
GUIDE = (ROOT / "docs" / "kubernetes.md").read_text()
RELEASES = ("1.31", "1.37")
"""The oldest that the manifests are for, and the newest whose schemas there are."""
PROGRAMS: dict[str, type[ServiceSettings]] = {
    "order-service": settings_with(OrderServiceSettings, order_service.installed()),
    "status-aggregator": settings_with(AggregatorSettings, aggregator.installed()),
}
NAME = "app.kubernetes.io/name"
INDEX = "apps.kubernetes.io/pod-index"
POD = {"metadata.name": "pod-1", f"metadata.labels['{INDEX}']": "1"}
"""What a pod knows of itself."""
KUSTOMIZATION: dict[str, Any] = yaml.safe_load((FOLDER / "kustomization.yaml").read_text())


def manifests(kind: str | None = None) -> list[Any]:
    found = [
        each
        for name in KUSTOMIZATION["resources"]
        for each in yaml.safe_load_all((FOLDER / name).read_text())
    ]
    return [each for each in found if kind in (None, each["kind"])]


def named(kind: str, name: str) -> Any:
    (found,) = [each for each in manifests(kind) if each["metadata"]["name"] == name]
    return found


def pod_of(name: str) -> Any:
    return named("StatefulSet", name)["spec"]["template"]


def container_of(name: str) -> Any:
    (only,) = pod_of(name)["spec"]["containers"]
    return only


def labels_of(name: str, index: int) -> set[tuple[str, str]]:
    return {*pod_of(name)["metadata"]["labels"].items(), (INDEX, str(index))}


def environment(name: str) -> dict[str, str]:
    """Return a container's variables as the kubelet sets them."""
    container = container_of(name)
    made: dict[str, str] = {}
    for source in container["envFrom"]:
        made |= named("ConfigMap", source["configMapRef"]["name"])["data"]
    for each in container["env"]:
        value = each.get("value") or POD[each["valueFrom"]["fieldRef"]["fieldPath"]]
        made[each["name"]] = re.sub(r"\$\((\w+)\)", lambda found: made[found.group(1)], value)
    return made


def files_made_by_the_guide() -> Iterator[tuple[str, str]]:
    """Yield each secret or config map with each of its files, as the guide's commands make them."""
    for line in re.findall(r"create (?:secret generic|configmap) (.*)", GUIDE):
        name, *sources = line.split()
        for source in sources:
            key, _, path = source.removeprefix("--from-file=").rpartition("=")
            yield name, key or PurePosixPath(path).name


def files_of(name: str) -> set[str]:
    """Return all files that a pod has mounted."""
    spec, found = pod_of(name)["spec"], set()
    volumes = {each["name"]: each for each in spec["volumes"]}
    for mount in container_of(name)["volumeMounts"]:
        volume = volumes.get(mount["name"], {})
        source = volume.get("secret", {}).get("secretName") or volume.get("configMap", {}).get("name")
        if source:
            keys = [key for made, key in files_made_by_the_guide() if made == source]
            assert keys, f"the guide does not make {source}"
            found |= {f"{mount['mountPath']}/{key}" for key in keys}
    return found


@pytest.mark.parametrize("release", RELEASES)
@pytest.mark.parametrize(
    "manifest", manifests(), ids=lambda each: f"{each['kind']}-{each['metadata']['name']}"
)
def test_manifest_matches_the_schema(manifest: Any, release: str) -> None:
    kubernetes_validate.validate(manifest, release, strict=True)


@pytest.mark.parametrize("name", PROGRAMS)
def test_environment_variables_are_valid_settings(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for variable, value in environment(name).items():
        monkeypatch.setenv(variable, value)

    settings: Any = load(PROGRAMS[name], [], program=name, description="")

    given = {each for each in environment(name) if each.startswith("NENA_")}
    assert {each for each in given if not is_set(settings, each)} == set()
    check_exposure(settings.http)
    assert settings.http.port == container_of(name)["ports"][0]["containerPort"]


def is_set(settings: Any, variable: str) -> bool:
    *tables, last = variable.removeprefix("NENA_").lower().split("__")
    for table in tables:
        settings = getattr(settings, table, None)
    return last in getattr(settings, "model_fields_set", ())


@pytest.mark.parametrize("name", PROGRAMS)
def test_files_named_by_settings_are_mounted(name: str) -> None:
    wanted = {value for value in environment(name).values() if value.startswith("/etc/nena/")}

    assert wanted == files_of(name)


@pytest.mark.parametrize("name", PROGRAMS)
def test_ports_and_probes_match_the_program(name: str) -> None:
    container = container_of(name)
    (port,) = container["ports"]
    exposed = re.findall(r"^EXPOSE (\d+)$", dockerfile(name), re.MULTILINE)

    assert exposed == [str(port["containerPort"])]
    probes = {key: value["httpGet"] for key, value in container.items() if key.endswith("Probe")}
    assert probes == {
        "startupProbe": {"path": "/healthz", "port": port["name"], "scheme": "HTTPS"},
        "livenessProbe": {"path": "/healthz", "port": port["name"], "scheme": "HTTPS"},
        "readinessProbe": {"path": "/readyz", "port": port["name"], "scheme": "HTTPS"},
    }
    for service in manifests("Service"):
        if service["spec"]["selector"][NAME] == name:
            assert service["spec"]["ports"] == [
                {"name": port["name"], "port": port["containerPort"], "targetPort": port["name"]}
            ]


def dockerfile(name: str) -> str:
    return (ROOT / "services" / name.replace("-", "_") / "Dockerfile").read_text()


@pytest.mark.parametrize("name", PROGRAMS)
def test_pods_are_restricted(name: str) -> None:
    spec, container = pod_of(name)["spec"], container_of(name)
    user = re.search(r"useradd --uid (\d+)", dockerfile(name))

    assert user is not None
    assert spec["automountServiceAccountToken"] is False
    assert spec["securityContext"] == {
        "runAsNonRoot": True,
        **dict.fromkeys(("runAsUser", "runAsGroup", "fsGroup"), int(user.group(1))),
        "seccompProfile": {"type": "RuntimeDefault"},
    }
    assert container["securityContext"] == {
        "allowPrivilegeEscalation": False,
        "readOnlyRootFilesystem": True,
        "capabilities": {"drop": ["ALL"]},
    }
    assert container["resources"].keys() == {"requests", "limits"}
    assert spec["terminationGracePeriodSeconds"] > 20, "as long as units and containers have"


@pytest.mark.parametrize("name", PROGRAMS)
def test_budgets_policies_and_services_select_their_pods(name: str) -> None:
    stateful = named("StatefulSet", name)["spec"]
    start = stateful.get("ordinals", {}).get("start", 0)
    pods = [labels_of(name, start + number) for number in range(stateful["replicas"])]
    for kind, at in (("PodDisruptionBudget", "selector"), ("NetworkPolicy", "podSelector")):
        selector = named(kind, name)["spec"][at]["matchLabels"]
        assert all(set(selector.items()) <= pod for pod in pods)
    for service in manifests("Service"):
        if service["spec"]["selector"][NAME] == name:
            assert any(set(service["spec"]["selector"].items()) <= pod for pod in pods), service["metadata"]
    assert named("Service", stateful["serviceName"])["spec"]["clusterIP"] == "None"


def test_each_share_of_the_robots_has_one_aggregator_and_its_panel() -> None:
    spec = named("StatefulSet", "status-aggregator")["spec"]
    (variable,) = [each for each in container_of("status-aggregator")["env"] if each["name"] == "NENA_SHARE"]
    first, count = spec["ordinals"]["start"], spec["replicas"]

    shares = [
        Share.read(variable["value"].replace("$(POD_INDEX)", str(first + each))) for each in range(count)
    ]

    assert shares == [Share(number, count) for number in range(1, count + 1)]
    panels = {each["spec"]["selector"].get(INDEX): each["metadata"]["name"] for each in manifests("Service")}
    hosts = {
        rule["host"]: rule["http"]["paths"][0]["backend"]["service"]["name"]
        for rule in named("Ingress", "nena")["spec"]["rules"]
    }
    ours = [host for host, service in hosts.items() if service.startswith("status-aggregator")]
    assert [hosts[host] for host in ours] == [panels[str(share.number)] for share in shares]
    assert json.loads(environment("status-aggregator")["NENA_ORDER_SERVICE__TRUSTED_HOSTS"]) == ours


def test_services_behind_the_ingress_require_a_login(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in environment("status-aggregator").items():
        monkeypatch.setenv(name, value)
    http = load(AggregatorSettings, [], program="p", description="d").http
    paths = [
        path["path"] for rule in named("Ingress", "nena")["spec"]["rules"] for path in rule["http"]["paths"]
    ]

    assert set(paths) == {"/"}
    assert make_rule(http)("GET", "/metrics") is Role.VIEWER


def test_a_standby_reaches_the_active_one_by_name() -> None:
    spec = named("StatefulSet", "order-service")["spec"]
    service = named("Service", spec["serviceName"])

    assert service["spec"]["publishNotReadyAddresses"] is True
    assert environment("order-service")["NENA_PUBLIC_URL"] == f"https://pod-1.{spec['serviceName']}:55200"
    assert spec["podManagementPolicy"] == "Parallel", "one of them is never ready"
    assert named("PodDisruptionBudget", "order-service")["spec"]["minAvailable"] == 0


def names_certified_by_the_guide(service: str) -> set[str]:
    """Return the names for which the guide makes the certificate of a service."""
    (command,) = re.findall(rf"^nena-deploy https site {service} (.*)$", GUIDE, re.MULTILINE)
    return set(re.findall(r"--host (\S+)", command))


def test_no_token_crosses_the_cluster_unencrypted() -> None:
    """From the ingress and from the aggregators on, requests are encrypted, and the services identified."""
    for name in PROGRAMS:
        assert {"NENA_HTTP__TLS_CERTIFICATE", "NENA_HTTP__TLS_KEY"} <= environment(name).keys()
    spec, variables = named("StatefulSet", "order-service")["spec"], environment("status-aggregator")
    pods = {f"order-service-{each}.{spec['serviceName']}" for each in range(spec["replicas"])}
    certified = names_certified_by_the_guide("order-service")
    assert pods | {urlsplit(variables["NENA_ORDER_SERVICE__URL"]).hostname} <= certified
    assert {"order-service.nena", "order-service.nena.svc"} <= certified  # names in other namespaces
    assert not [value for name in PROGRAMS for value in environment(name).values() if "http://" in value]
    assert variables["NENA_ORDER_SERVICE__CA"] in files_of("status-aggregator")

    asked = named("Ingress", "nena")["metadata"]["annotations"]
    prefix = "nginx.ingress.kubernetes.io"
    assert (asked[f"{prefix}/backend-protocol"], asked[f"{prefix}/proxy-ssl-verify"]) == ("HTTPS", "on")
    assert all(asked[f"{prefix}/proxy-ssl-name"] in names_certified_by_the_guide(each) for each in PROGRAMS)
    namespace, _, secret = asked[f"{prefix}/proxy-ssl-secret"].partition("/")
    assert namespace == KUSTOMIZATION["namespace"]
    assert (secret, "ca.crt") in set(files_made_by_the_guide())


def test_policies_allow_the_configured_connections() -> None:
    def open_ports(name: str) -> set[object]:
        rules = named("NetworkPolicy", name)["spec"]["egress"]
        return {port["port"] for rule in rules for port in rule["ports"]}

    broker = int(environment("order-service")["NENA_MQTT__PORT"])
    assert open_ports("order-service") == {53, broker, 5432}
    assert open_ports("status-aggregator") == {53, broker, "http"}
