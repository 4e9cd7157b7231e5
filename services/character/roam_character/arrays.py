"""One array type for the maths of this package: numpy arrays and torch tensors alike.

Every function of `rotation` and `kinematics` takes either kind and answers with the same kind, on the same device. The
common ground is the Python array API standard; torch is never imported here, so a client without torch can use it.
"""

from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np
from array_api_compat import array_namespace, device

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


def indices_like(values: Any, array: Array) -> Array:
    """Integer indices as an array of the kind and device of `array`."""
    xp = array_namespace(array)
    return cast(Array, xp.asarray(values, dtype=xp.int64, device=device(array)))
