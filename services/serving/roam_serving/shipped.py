"""Files that come with the product: weights, reference poses and example furniture, in a checkout and in a wheel.

In a checkout they lie in `weights/` and `examples/`; in a wheel they are data of this package, put there by
requirements/wheel_files.py.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from safetensors import SafetensorError

from roam_serving.settings import SettingsError

_CHECKOUT = Path(__file__).resolve().parents[3]
_DATA = Path(__file__).parent / "data"


def checkout() -> Path | None:
    """The root of the checkout that this package runs from; None when it was installed from a wheel."""
    return None if _DATA.is_dir() else _CHECKOUT


def _folder(in_checkout: str, in_wheel: str) -> Path:
    root = checkout()
    return _DATA / in_wheel if root is None else root / in_checkout


WEIGHTS = _folder("weights", "weights")
REFERENCES = _folder("examples/references", "references")
OBJECTS = _folder("examples/objects", "objects")


@contextmanager
def weights_of(model: str, path: Path) -> Iterator[None]:
    """Around the reading of a file of weights: SettingsError naming the file when it holds something else."""
    try:
        yield
    except (KeyError, ValueError, RuntimeError, TypeError, SafetensorError) as error:
        raise SettingsError(f"{path} does not hold weights of {model}: {type(error).__name__}: {error}") from error
