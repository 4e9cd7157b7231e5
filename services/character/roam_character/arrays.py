"""One array type for the maths of this package: numpy arrays and torch tensors alike.

Every function of `rotation` and `kinematics` takes either kind and answers with the same kind, on the same device. The
common ground is the Python array API standard; torch is never imported here, so a client without torch can use it.
"""

from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
from array_api_compat import array_namespace, device, is_torch_namespace

if TYPE_CHECKING:
    import torch

Array = TypeVar("Array", np.ndarray, "torch.Tensor")


def namespace(*arrays: Any) -> Any:
    """The array API namespace (numpy or torch) of the arguments."""
    return array_namespace(*arrays)


def like(values: Any, array: Array) -> Array:
    """`values` as an array of the kind, dtype and device of `array`."""
    xp = array_namespace(array)
    return cast(Array, xp.asarray(values, dtype=array.dtype, device=device(array)))


Numbers = tuple[float, ...] | tuple[tuple[float, ...], ...]


def constant(values: Numbers, array: Array) -> Array:
    """`like` for numbers that are known beforehand: made once for every dtype and device, not to be written to."""
    return cast(Array, _constant(values, array_namespace(array), array.dtype, device(array)))


@cache
def _constant(values: Numbers, xp: Any, dtype: Any, place: Any) -> Any:
    if not is_torch_namespace(xp):
        return xp.asarray(values, dtype=dtype, device=place)
    import torch  # loaded already: the caller has a tensor

    with torch.inference_mode(False):  # else what was first asked for there could never be differentiated
        return torch.tensor(values, dtype=dtype, device=place)


def indices(values: tuple[int, ...], array: Array) -> Array:
    """Integers of the kind and device of `array`, made once."""
    xp = array_namespace(array)
    return cast(Array, _constant(values, xp, xp.int64, device(array)))
