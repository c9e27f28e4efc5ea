"""The Kubernetes manifests on an existing cluster: `make test-kube` (tests/infra/README.md).

`kubectl` must answer. The tests own the namespace pbrs-farm: they create and delete it.
PBRS_TEST_KUBE_IMAGE, PBRS_TEST_KUBE_REDIS_IMAGE: images that the nodes have or can pull.
PBRS_TEST_KUBE_NEXT_IMAGE: the image to roll out; by default the same image again.
"""

from __future__ import annotations

import json
import os
import secrets
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import pytest

from tests.workers.small_farm import REPO

pytestmark = pytest.mark.kube

MANIFESTS: Final = REPO / "deploy/kubernetes"
NAMESPACE: Final = "pbrs-farm"
KINDS_OF_KEDA: Final = ("scaledobjects.keda.sh", "triggerauthentications.keda.sh")
# A generated room; light takes some seconds a view, so that tasks can be caught running.
JOB: Final = ("builtin", "--recipe", "preview", "--size", "160x120", "--set", "light.denoise=false")
# Only sizes for the lab: nodes use the images they have, and two cores are enough.
_PATCHES: Final = """
  - target: {kind: Deployment}
    patch: |
      - {op: add, path: /spec/template/spec/containers/0/imagePullPolicy, value: IfNotPresent}
  - target: {kind: StatefulSet}
    patch: |
      - {op: add, path: /spec/template/spec/containers/0/imagePullPolicy, value: IfNotPresent}
  - target: {kind: Deployment, name: worker}
    patch: |
      - {op: replace, path: /spec/template/spec/containers/0/resources/requests, value: {cpu: 100m, memory: 1Gi}}
  - target: {kind: ConfigMap, name: pbrs-farm}
    patch: |
      - {op: add, path: /data/PBRS_FARM_LEASE_S, value: "30"}
      - {op: add, path: /data/PBRS_FARM_HEARTBEAT_S, value: "5"}
"""
_OLDER_BUDGETS: Final = """
  - target: {kind: PodDisruptionBudget}
    options: {allowKindChange: true}
    patch: |
      - {op: replace, path: /apiVersion, value: policy/v1beta1}
"""


@dataclass(frozen=True, slots=True)
class Cluster:
    """The cluster of kubectl, and the applied overlay."""

    overlay: Path

    def get(self, what: str, *words: str) -> Any:
        return json.loads(kubectl("-n", NAMESPACE, "get", what, *words, "-o", "json"))

    def pods(self, name: str) -> list[dict[str, Any]]:
        """The pods of a Deployment or StatefulSet that are not terminating."""
        pods = self.get("pods", "-l", f"app.kubernetes.io/name={name}")["items"]
        return [pod for pod in pods if "deletionTimestamp" not in pod["metadata"]]

    def n_restarts(self, name: str) -> int:
        states = [s for pod in self.pods(name) for s in pod["status"].get("containerStatuses", ())]
        return sum(int(s["restartCount"]) for s in states)

    def farm(self, *words: str) -> str:
        """Output of a farm command in the coordinator's pod."""
        command = ("exec", "deploy/coordinator", "--", "pbrs-farm", *words)
        return kubectl("-n", NAMESPACE, *command)

    def status(self, job: str) -> dict[str, Any]:
        command = ("exec", "deploy/coordinator", "--", "pbrs-farm", "status", "--json", job)
        done = _ran("-n", NAMESPACE, *command)
        status: dict[str, Any] = json.loads(done.stdout) if done.stdout else {"state": done.stderr}
        return status

    def submit(self, seed: int, views: int) -> str:
        words = ("--seed", str(seed), "--views", str(views), "--update")
        return self.farm("submit", *JOB, *words).strip().splitlines()[-1]

    def workers(self) -> dict[str, str]:
        """Name -> state of the workers."""
        return {row["worker"]: row["state"] for row in json.loads(self.farm("workers", "--json"))}

    def alive(self) -> list[str]:
        return [name for name, state in self.workers().items() if state == "alive"]

    def redis(self, *words: str) -> str:
        script = 'REDISCLI_AUTH=$(cat /run/pbrs/redis_password) redis-cli --user farm "$@"'
        return kubectl("-n", NAMESPACE, "exec", "redis-0", "--", "sh", "-c", script, "-", *words)

    def rolled_out(self, *what: str) -> None:
        for name in what:
            kubectl("-n", NAMESPACE, "rollout", "status", name, "--timeout=300s")

    def light_runs(self, job: str) -> None:
        """Wait until a light task runs."""
        wait(lambda: _running(self.status(job), "light") > 0, 240, f"light of job {job} runs")

    def ends(self, job: str, *, lost: int = 0) -> dict[str, Any]:
        """Wait for the job's end; at most `lost` attempts may have failed."""
        wait(lambda: self.status(job)["state"].startswith("done"), 600, f"job {job} is done")
        status = self.status(job)
        assert status["state"] == "done", status
        attempts = status["failed_attempts"]
        assert set(attempts) <= {"lost"}, status
        assert attempts.get("lost", 0) <= lost, status
        return status


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    """The overlay `small` on the cluster with all pods ready."""
    _check()
    cluster_here = Cluster(_overlay(tmp_path_factory.mktemp("kube")))
    kubectl("create", "namespace", NAMESPACE)
    try:
        values = {f"--from-literal={k}={secrets.token_hex(16)}" for k in _SECRETS}
        kubectl("-n", NAMESPACE, "create", "secret", "generic", "pbrs-farm", *sorted(values))
        kubectl("apply", "-k", str(cluster_here.overlay))
        cluster_here.rolled_out("statefulset/redis", "deployment/coordinator", "deployment/worker")
        wait(lambda: len(cluster_here.alive()) == 1, 120, "a worker registers")
        _say_what_is_not_tested(cluster_here)
        yield cluster_here
    finally:
        if os.environ.get("PBRS_TEST_KUBE_KEEP") != "1":
            _ran("delete", "namespace", NAMESPACE, "--timeout=180s")


_SECRETS: Final = ("redis_password", "keda_password", "s3_secret_key")


@pytest.mark.parametrize("folder", ["base", "overlays/small", "overlays/gpu"])
def test_the_server_takes_every_object(folder: str, cluster: Cluster) -> None:
    overlay = _overlay(cluster.overlay.parent / folder.replace("/", "-"), folder)
    answer = kubectl("apply", "--dry-run=server", "-k", str(overlay))
    assert "statefulset.apps/redis" in answer
    assert "scaledobject.keda.sh/worker" in answer


def test_nothing_restarts_while_it_is_installed_and_the_readme_s_last_step_is_well(
    cluster: Cluster,
) -> None:
    assert [cluster.n_restarts(name) for name in ("redis", "coordinator", "worker")] == [0, 0, 0]
    assert "no job yet; 1 worker" in cluster.farm("status")


def test_keda_s_objects_are_as_they_were_written(cluster: Cluster) -> None:
    scaled = cluster.get("scaledobject", "worker")["spec"]
    names = {t["name"] for t in scaled["triggers"]}
    assert set(scaled["advanced"]["scalingModifiers"]["formula"].split(" + ")) == names
    assert scaled["maxReplicaCount"] == 4
    patch = '{"spec": {"maxReplicaCount": "many"}}'
    refused = _ran("-n", NAMESPACE, "patch", "scaledobject", "worker", "--type=merge", "-p", patch)
    assert refused.returncode != 0


def test_a_job_runs_to_its_end_on_pods(cluster: Cluster) -> None:
    job = cluster.submit(1, views=2)
    assert cluster.ends(job)["views_done"] == 2


def test_a_restarted_redis_keeps_every_key_and_the_job_continues(cluster: Cluster) -> None:
    job = cluster.submit(2, views=6)
    cluster.light_runs(job)
    jobs = {row["job"] for row in json.loads(cluster.farm("jobs", "--json"))}
    assert len(jobs) >= 2
    kubectl("-n", NAMESPACE, "delete", "pod", "redis-0")
    cluster.rolled_out("statefulset/redis")
    assert {row["job"] for row in json.loads(cluster.farm("jobs", "--json"))} == jobs
    assert cluster.ends(job)["views_done"] == 6
    assert cluster.n_restarts("coordinator") == cluster.n_restarts("worker") == 0


def test_a_worker_s_pod_that_is_killed_loses_nothing(cluster: Cluster) -> None:
    job = cluster.submit(3, views=6)
    cluster.light_runs(job)
    (pod,) = cluster.pods("worker")
    name = pod["metadata"]["name"]
    kubectl("-n", NAMESPACE, "delete", "pod", name, "--grace-period=0", "--force")
    assert cluster.ends(job, lost=2)["views_done"] == 6
    assert name not in cluster.alive()


def test_a_drained_worker_stays_drained_until_undrained(cluster: Cluster) -> None:
    (name,) = cluster.alive()
    cluster.farm("drain", name)
    try:
        # The container ends and is restarted under the same name.
        wait(lambda: cluster.workers()[name] == "drained", 300, f"{name} is drained")
        job = cluster.submit(4, views=1)
        time.sleep(10)
        assert cluster.status(job)["views_done"] == 0
    finally:
        cluster.farm("drain", "--undo", name)
    cluster.ends(job)


def test_more_replicas_are_more_workers_and_fewer_lose_nothing(cluster: Cluster) -> None:
    scale = ("-n", NAMESPACE, "scale", "deployment/worker")
    kubectl(*scale, "--replicas=2")
    try:
        wait(lambda: len(cluster.alive()) == 2, 300, "two workers")
        job = cluster.submit(5, views=4)
        cluster.light_runs(job)
    finally:
        kubectl(*scale, "--replicas=1")
    cluster.ends(job)
    wait(lambda: len(cluster.alive()) == 1, 300, "one worker")


def test_a_new_image_is_rolled_out_under_a_running_job(cluster: Cluster) -> None:
    job = cluster.submit(6, views=4)
    cluster.light_runs(job)
    (before,) = cluster.alive()
    image = os.environ.get("PBRS_TEST_KUBE_NEXT_IMAGE", "")
    for name in ("worker", "coordinator"):
        words = ("set", "image", f"deployment/{name}", f"{name}={image}")
        restart = ("rollout", "restart", f"deployment/{name}")
        kubectl("-n", NAMESPACE, *(words if image else restart))
    cluster.ends(job)
    cluster.rolled_out("deployment/coordinator", "deployment/worker")
    wait(lambda: len(cluster.alive()) == 1 and before not in cluster.alive(), 300, "a new worker")


def test_a_node_can_be_drained_of_every_pod(cluster: Cluster) -> None:
    nodes = {pod["spec"]["nodeName"] for n in _PARTS for pod in cluster.pods(n)}
    selector = f"app.kubernetes.io/name in ({', '.join(_PARTS)})"
    words = ("--ignore-daemonsets", "--delete-emptydir-data", "--timeout=180s")
    try:
        for node in sorted(nodes):
            kubectl("drain", node, *words, "--pod-selector", selector)
    finally:
        for node in sorted(nodes):
            kubectl("uncordon", node)
    cluster.rolled_out("statefulset/redis", "deployment/coordinator", "deployment/worker")
    job = cluster.submit(7, views=1)
    cluster.ends(job)


_PARTS: Final = ("redis", "coordinator", "worker")


def kubectl(*words: str) -> str:
    """Output of kubectl; fails with its error."""
    done = _ran(*words)
    assert done.returncode == 0, f"kubectl {' '.join(words)}: {done.stderr}"
    return done.stdout


def _ran(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(["kubectl", *words], capture_output=True, text=True, check=False)


def wait(holds: Callable[[], bool], at_most_s: float, what: str) -> None:
    """Wait until `holds()`; `what` describes it in the failure."""
    end = time.monotonic() + at_most_s
    while not holds():
        assert time.monotonic() < end, f"after {at_most_s:.0f} s not yet: {what}"
        time.sleep(1.0)


def _running(status: dict[str, Any], stage: str) -> int:
    return sum(s["running"] for s in status.get("stages", ()) if s["stage"] == stage)


def _check() -> None:
    """Fail with a list of all missing programs and settings."""
    if shutil.which("kubectl") is None:
        pytest.fail("make test-kube needs kubectl on the PATH", pytrace=False)
    nodes = _ran("get", "nodes", "-o", "name", "--request-timeout=10s")
    if nodes.returncode != 0:
        text = f"make test-kube needs a cluster that `kubectl get nodes` reaches (KUBECONFIG): {nodes.stderr.strip()}"
        pytest.fail(text, pytrace=False)
    missing = [
        f"KEDA's kind {kind} (kubectl apply -f its CRD)"
        for kind in KINDS_OF_KEDA
        if _ran("get", "crd", kind).returncode != 0
    ]
    classes = json.loads(kubectl("get", "storageclass", "-o", "json"))["items"]
    default = "storageclass.kubernetes.io/is-default-class"
    if not any(c["metadata"].get("annotations", {}).get(default) == "true" for c in classes):
        missing.append("a default StorageClass, for claims of 100Gi ReadWriteMany and 10Gi")
    if _ran("get", "namespace", NAMESPACE).returncode == 0:
        missing.append(f"that no namespace {NAMESPACE} is there (the tests make it and take it)")
    if not os.environ.get("PBRS_TEST_KUBE_IMAGE"):
        missing.append("PBRS_TEST_KUBE_IMAGE: NAME:TAG of docker/Dockerfile's image")
    if missing:
        pytest.fail("make test-kube lacks:\n  " + "\n  ".join(missing), pytrace=False)


def _overlay(folder: Path, project: str = "overlays/small") -> Path:
    """Write an overlay over one of the project's, with this cluster's images; returns its folder."""
    # kustomize reads no folder from elsewhere: both are copied side by side.
    shutil.copytree(MANIFESTS, folder / "project", dirs_exist_ok=True)
    named = {"registry.example.org/pbrs-farm": os.environ["PBRS_TEST_KUBE_IMAGE"]}
    named["docker.io/library/redis"] = os.environ.get("PBRS_TEST_KUBE_REDIS_IMAGE", "redis:7.2")
    images = "".join(
        f"  - {{name: {name}, newName: {image.rpartition(':')[0]}, newTag: {image.rpartition(':')[2]}}}\n"
        for name, image in named.items()
    )
    # Clusters before 1.21 have disruption budgets only in another version.
    is_older = "policy/v1\n" not in kubectl("api-versions") and project != "overlays/small"
    older = _OLDER_BUDGETS if is_older else ""
    overlay = folder / "here"
    overlay.mkdir()
    (overlay / "kustomization.yaml").write_text(
        "apiVersion: kustomize.config.k8s.io/v1beta1\nkind: Kustomization\n"
        f"resources: [../project/{project}]\nimages:\n{images}patches:{_PATCHES}{older}"
    )
    return overlay


def _say_what_is_not_tested(at: Cluster) -> None:
    """Print the parts that this cluster cannot test."""
    lacks = []
    if len(json.loads(kubectl("get", "nodes", "-o", "json"))["items"]) < 2:
        lacks.append("one node: no spreading, and a drain leaves its pods waiting")
    if _ran("get", "deployments", "-A", "-l", "app=keda-operator", "-o", "name").stdout == "":
        lacks.append("no operator of KEDA: its objects are taken, and nothing scales by them")
    # The worker may reach Redis, a pod without its label may not.
    (pod,) = at.pods("redis")
    script = f"import socket; socket.create_connection(('{pod['status']['podIP']}', 6379), 5)"
    image = os.environ["PBRS_TEST_KUBE_IMAGE"]
    words = ("run", "stranger", f"--image={image}", "--image-pull-policy=IfNotPresent")
    words += ("--restart=Never", "--rm", "--attach", "--quiet", "--command", "--", "python", "-c")
    if _ran("-n", NAMESPACE, *words, script).returncode == 0:
        lacks.append("no network policies: a stranger's pod reached Redis")
    for line in lacks:
        sys.stdout.write(f"\nnot tested here: {line}\n")
