"""A docker-compose stack for tests: the machine's own engine, or one that engine scripts put up and take down.

The scripts (`ROAM_ENGINE_SCRIPTS`, default ../shared/compose-engine beside the checkout) need root and Debian, and tag
local stand-ins with the names of the base images: what is special to the real slim image is not tested with them.
"""

import json
import os
import shutil
import socket
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
PROJECT = "roam-test"


def run(command: Sequence[str | Path], env: dict[str, str], *, seconds: float) -> str:
    """Runs in the repository; what it printed, or an AssertionError that shows the end of it."""
    done = subprocess.run(
        [str(part) for part in command],
        cwd=ROOT,
        env=os.environ | env,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=seconds,
        check=False,
    )
    assert done.returncode == 0, f"{' '.join(map(str, command))} ended with {done.returncode}:\n{done.stdout[-6000:]}"
    return done.stdout


def engine_scripts() -> Path | None:
    """The folder of the engine scripts, if they can be used here."""
    folder = Path(os.environ.get("ROAM_ENGINE_SCRIPTS") or ROOT.parent / "shared" / "compose-engine")
    usable = os.geteuid() == 0 and shutil.which("apt-get") and (folder / "engine.sh").is_file()
    return folder if usable else None


def engine_answers() -> bool:
    """Whether docker with compose runs here already."""
    if shutil.which("docker") is None:
        return False
    checks = (["docker", "version"], ["docker", "compose", "version"])
    return all(subprocess.run(c, capture_output=True, timeout=30, check=False).returncode == 0 for c in checks)


@contextmanager
def engine() -> Iterator[dict[str, str]]:
    """A running engine; the environment that reaches it. The one that this starts is stopped at the end."""
    scripts = engine_scripts()
    if engine_answers() or scripts is None:
        yield {}
        return
    home = Path(os.environ.get("ENGINE_DIR") or Path.home() / ".cache" / "compose-engine")
    env = {"ENGINE_DIR": str(home), "DOCKER_HOST": f"unix://{home}/docker.sock"}
    run(["bash", scripts / "engine.sh", "install"], env, seconds=600)
    try:
        run(["bash", scripts / "engine.sh", "start"], env, seconds=120)
        run(["bash", scripts / "base-images.sh"], env, seconds=600)
        yield env
    finally:
        run(["bash", scripts / "engine.sh", "stop"], env, seconds=120)


def free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


@dataclass(frozen=True)
class Stack:
    """The whole of docker-compose.yml, its gateway published on a port of 127.0.0.1 that was free."""

    env: dict[str, str]
    port: int = field(default_factory=free_port)

    @property
    def address(self) -> str:
        """Of the gateway, for gRPC."""
        return f"127.0.0.1:{self.port}"

    @property
    def url(self) -> str:
        """Of the gateway, for HTTP."""
        return f"http://{self.address}"

    def compose(self, *arguments: str, seconds: float = 120) -> str:
        env = self.env | {"ROAM_PORT": str(self.port), "ROAM_WORKERS": "1"}
        return run(["docker", "compose", "-p", PROJECT, *arguments], env, seconds=seconds)

    def docker(self, *arguments: str) -> str:
        return run(["docker", *arguments], self.env, seconds=60)

    def up(self, *arguments: str) -> None:
        """Starts what does not run and waits until all of it is healthy."""
        try:
            self.compose("up", "--detach", "--wait", "--wait-timeout", "300", *arguments, seconds=360)
        except AssertionError as error:
            raise AssertionError(f"{error}\n{self.compose('logs', '--tail', '60')}") from None

    def containers(self, service: str) -> list[str]:
        """Ids of the running replicas of a service."""
        return self.compose("ps", "-q", service).split()

    def state(self, container: str) -> dict[str, Any]:
        """What docker knows of a container."""
        return dict(json.loads(self.docker("inspect", container))[0])

    def metric(self, container: str, name: str) -> float:
        """A metric of one replica, read inside its container; 0 where it does not answer or never counted."""
        read = "import urllib.request as r; print(r.urlopen('http://127.0.0.1:8080/metrics').read().decode())"
        try:
            text = self.docker("exec", container, "python", "-c", read)
        except AssertionError:
            return 0.0
        return next((float(line.split()[-1]) for line in text.splitlines() if line.startswith(f"{name} ")), 0.0)

    def owner(self) -> str:
        """The motion replica that sends the only stream there is."""
        return next(name for name in self.containers("motion") if self.metric(name, "roam_motion_streams") > 0)


@contextmanager
def stack() -> Iterator[Stack]:
    """The stack of docker-compose.yml, built, healthy, and removed at the end."""
    with engine() as env:
        running = Stack(env)
        try:
            running.compose("build", seconds=1800)
            running.up()
            yield running
        finally:
            running.compose("down", "--volumes", "--timeout", "30")
