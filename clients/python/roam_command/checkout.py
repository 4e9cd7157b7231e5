"""The checkout that this command runs from, if it does."""

from pathlib import Path

from roam_command.reports import UsageError

_ROOT = Path(__file__).resolve().parents[3]
DEFAULT_OBJECT = "chair"


def checkout() -> Path | None:
    """The root of the checkout; None when the command was installed from a wheel."""
    return _ROOT if (_ROOT / "examples" / "objects").is_dir() else None


def bundled_objects() -> dict[str, Path]:
    """The furniture in examples/objects by name; empty without a checkout."""
    root = checkout()
    return {path.stem: path for path in sorted((root / "examples" / "objects").glob("*.glb"))} if root else {}


def bundled_object(name: str) -> Path:
    """One of them. UsageError when there is none of this name."""
    objects = bundled_objects()
    if name not in objects:
        raise UsageError(f"no bundled object {name}", remedy="Give a furniture file: roam demo OBJECT.")
    return objects[name]
