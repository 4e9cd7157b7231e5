"""The product as a stranger gets it: wheels, installed into environments of their own."""

import os
import subprocess
import sys
import sysconfig
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Installation:
    """An environment with one of the wheels, away from the checkout."""

    folder: Path

    @property
    def environment(self) -> dict[str, str]:
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "ROAM_"))}
        return kept | {"OMP_NUM_THREADS": "1"}

    def program(self, name: str) -> str:
        return str(self.folder / "bin" / name)

    def run(self, *arguments: object, program: str = "roam", timeout: int = 240) -> subprocess.CompletedProcess[str]:
        command = [self.program(program), *map(str, arguments)]
        return subprocess.run(
            command, cwd=self.folder, env=self.environment, capture_output=True, text=True, timeout=timeout, check=False
        )


def install(wheel: Path, folder: Path) -> Installation:
    """Installs a wheel without its dependencies, which the environment of the tests lends.

    Packages on a path that a .pth file names are seen, but .pth files on that path are not read: this project's own
    editable installation stays out.
    """
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True, timeout=120)
    site = Path(sysconfig.get_path("purelib", "venv", {"base": str(folder), "platbase": str(folder)}))
    (site / "lent.pth").write_text(sysconfig.get_path("purelib") + "\n")
    pip = [sys.executable, "-m", "pip", "--python", str(folder / "bin/python"), "install", "--quiet"]
    subprocess.run([*pip, "--no-deps", "--no-index", str(wheel)], check=True, timeout=240)
    return Installation(folder)


@pytest.fixture(scope="session")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Both wheels by the name of their distribution."""
    pytest.importorskip("hatchling", reason="needs hatchling to build wheels without a network")
    folder = tmp_path_factory.mktemp("wheels")
    pip = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w", str(folder)]
    subprocess.run([*pip, str(ROOT), str(ROOT / "clients/python")], check=True, timeout=300)
    return {path.name.partition("-")[0].replace("_", "-"): path for path in folder.glob("*.whl")}


@pytest.fixture(scope="session")
def product(wheels: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Installation:
    """Everything, installed."""
    pytest.importorskip("torch", reason="needs torch to run the services")
    return install(wheels["roam-services"], tmp_path_factory.mktemp("product"))


@pytest.fixture(scope="session")
def client(wheels: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Installation:
    """The client alone, installed."""
    return install(wheels["roam-services-client"], tmp_path_factory.mktemp("client"))
