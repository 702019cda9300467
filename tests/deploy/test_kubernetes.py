"""The Kubernetes manifests, by the schemas of Kubernetes and of the Dask operator; no cluster is asked."""

import importlib.util
from pathlib import Path
from typing import Any

import jsonschema
import kubernetes_validate
import pytest

from tests.deploy.paths import DEPLOY, documents

FOLDER = DEPLOY / "kubernetes"
KUSTOMIZATION = documents(FOLDER / "kustomization.yaml")[0]
MANIFESTS = [manifest for name in KUSTOMIZATION["resources"] for manifest in documents(FOLDER / name)]
DASK = "kubernetes.dask.org/v1"
VERSION = "1.31"
"""The oldest Kubernetes whose podFailurePolicy is no preview."""


def named(manifest: dict[str, Any]) -> str:
    return f"{manifest['kind']}/{manifest['metadata']['name']}"


def only(kind: str) -> dict[str, Any]:
    (manifest,) = [manifest for manifest in MANIFESTS if manifest["kind"] == kind]
    return manifest


def pod_specs() -> dict[str, dict[str, Any]]:
    cluster = only("DaskCluster")["spec"]
    return {
        "scheduler": cluster["scheduler"]["spec"],
        "worker": cluster["worker"]["spec"],
        "launcher": only("Job")["spec"]["template"]["spec"],
    }


def test_every_manifest_is_in_the_kustomization() -> None:
    files = {path.name for path in FOLDER.glob("*.yaml")} - {"kustomization.yaml", "search.yaml"}
    assert files == set(KUSTOMIZATION["resources"])


@pytest.mark.parametrize("manifest", [m for m in MANIFESTS if m["apiVersion"] != DASK], ids=named)
def test_a_built_in_kind_follows_its_schema(manifest: dict[str, Any]) -> None:
    kubernetes_validate.validate(manifest, VERSION, strict=True)


@pytest.mark.parametrize("name", ["scheduler", "worker"])
def test_the_pods_of_the_dask_cluster_follow_the_schema_of_pods(name: str) -> None:
    pod = {"apiVersion": "v1", "kind": "Pod", "metadata": {"name": name}, "spec": pod_specs()[name]}
    kubernetes_validate.validate(pod, VERSION, strict=True)


@pytest.mark.parametrize("manifest", [m for m in MANIFESTS if m["apiVersion"] == DASK], ids=named)
def test_a_kind_of_the_dask_operator_follows_its_definition(manifest: dict[str, Any]) -> None:
    # Looked up, not imported: the definitions need none of the operator's many dependencies.
    package = importlib.util.find_spec("dask_kubernetes")
    if package is None or package.origin is None:
        pytest.skip("the definitions come with dask-kubernetes: pip install --no-deps dask-kubernetes")
    definitions = Path(package.origin).parent / "operator/deployment/helm/dask-kubernetes-operator/crds"
    definition = documents(definitions / f"{manifest['kind'].lower()}.yaml")[0]["spec"]
    (version,) = [version for version in definition["versions"] if version["name"] == "v1"]
    assert manifest["apiVersion"] == f"{definition['group']}/{version['name']}"
    jsonschema.validate(manifest, _closed(version["schema"]["openAPIV3Schema"]))


def _closed(schema: Any) -> Any:
    """`schema` without room for keys that it does not name, which Kubernetes would drop silently."""
    if isinstance(schema, list):
        return [_closed(entry) for entry in schema]
    if not isinstance(schema, dict):
        return schema
    closed = {key: _closed(value) for key, value in schema.items()}
    if isinstance(schema.get("properties"), dict) and "additionalProperties" not in schema:
        closed["additionalProperties"] = schema.get("x-kubernetes-preserve-unknown-fields", False)
        if "spec" in schema["properties"] and "status" in schema["properties"]:
            closed["properties"] |= {"apiVersion": {}, "kind": {}, "metadata": {}}
    return closed


@pytest.mark.parametrize("spec", pod_specs().values(), ids=pod_specs().keys())
def test_a_pod_is_confined(spec: dict[str, Any]) -> None:
    assert spec["securityContext"]["runAsNonRoot"] is True
    assert spec["securityContext"]["runAsUser"] == 10001
    assert spec["automountServiceAccountToken"] is False
    for container in spec["containers"]:
        context = container["securityContext"]
        assert context["readOnlyRootFilesystem"] is True
        assert context["allowPrivilegeEscalation"] is False
        assert context["capabilities"] == {"drop": ["ALL"]}
        assert container["resources"]["limits"]["memory"]


def test_every_mount_has_its_volume() -> None:
    for spec in pod_specs().values():
        volumes = {volume["name"] for volume in spec["volumes"]}
        mounts = {mount["name"] for container in spec["containers"] for mount in container["volumeMounts"]}
        assert mounts == volumes


def test_bad_input_is_not_tried_again_and_a_clean_stop_is_no_failure() -> None:
    rules = only("Job")["spec"]["podFailurePolicy"]["rules"]
    actions = {
        status: rule["action"] for rule in rules for status in rule.get("onExitCodes", {}).get("values", [])
    }
    assert actions == {2: "FailJob", 130: "Ignore", 143: "Ignore"}


def test_a_run_is_held_by_one_pod_at_a_time() -> None:
    assert only("PersistentVolumeClaim")["spec"]["accessModes"] == ["ReadWriteOncePod"]
    assert only("Job")["spec"]["podReplacementPolicy"] == "Failed"


def test_the_scheduler_answers_to_our_pods_and_the_operator_only() -> None:
    policies = {m["metadata"]["name"]: m["spec"] for m in MANIFESTS if m["kind"] == "NetworkPolicy"}
    service = only("DaskCluster")["spec"]["scheduler"]["service"]
    scheduler = policies["gpsearch-scheduler"]
    assert scheduler["podSelector"]["matchLabels"] == service["selector"]
    by_port = {rule["ports"][0]["port"]: rule["from"] for rule in scheduler["ingress"]}
    assert set(by_port) == {port["port"] for port in service["ports"]}
    assert not any("namespaceSelector" in peer for peer in by_port[8786])
    launcher = only("Job")["spec"]["template"]["metadata"]["labels"]
    assert {"podSelector": {"matchLabels": launcher}} in by_port[8786]


def test_the_names_fit_together() -> None:
    cluster = only("DaskCluster")["metadata"]["name"]
    assert only("DaskAutoscaler")["spec"]["cluster"] == cluster
    # The operator names the service after the cluster.
    address = documents(FOLDER / "search.yaml")[0]["executor"]["scheduler"]
    assert address == f"tcp://{cluster}-scheduler:8786"
    volumes = {volume["name"]: volume for volume in pod_specs()["launcher"]["volumes"]}
    claim = only("PersistentVolumeClaim")["metadata"]["name"]
    assert volumes["runs"]["persistentVolumeClaim"]["claimName"] == claim
    assert volumes["configuration"]["configMap"]["name"] == KUSTOMIZATION["configMapGenerator"][0]["name"]
