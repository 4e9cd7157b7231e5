"""Rotations: unit quaternions `xyzw`, the 6D form that networks use, rotation vectors that the optimiser uses, yaw.

All functions broadcast over leading axes and take numpy arrays or torch tensors; in torch they are differentiable but
at half turns.
"""

from typing import Any

from array_api_compat import is_torch_namespace

from roam_character.arrays import Array, constant, indices, like, namespace

# Below this, a squared length counts as zero: keeps square roots differentiable at the identity.
_TINY = 1e-16

# The Hamilton product as a small matrix made of the left factor: which component stands where, and with which sign.
_PLACES = (3, 2, 1, 0, 2, 3, 0, 1, 1, 0, 3, 2, 0, 1, 2, 3)
_SIGNS = ((1.0, -1.0, 1.0, 1.0), (1.0, 1.0, -1.0, 1.0), (-1.0, 1.0, 1.0, 1.0), (-1.0, -1.0, -1.0, 1.0))
_CONJUGATE = (-1.0, -1.0, -1.0, 1.0)
_IDENTITY = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _squares() -> tuple[tuple[float, ...], ...]:
    """How a rotation matrix less the identity is made of the products q_a q_b: [16, 9]."""
    parts = [[0.0] * 9 for _ in range(16)]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        parts[5 * j][4 * i] = parts[5 * k][4 * i] = -2.0
        for place in (3 * i + j, 3 * j + i):
            parts[4 * i + j][place] = 2.0
        parts[4 * k + 3][3 * i + j], parts[4 * k + 3][3 * j + i] = -2.0, 2.0
    return tuple(tuple(row) for row in parts)


_SQUARES = _squares()


def _shepperd() -> tuple[tuple[float, ...], ...]:
    """[9, 16]: a matrix's entries times this, plus `_ONES`, are its quaternion times 4 x, times 4 y, 4 z and 4 w."""
    parts = [[0.0] * 16 for _ in range(9)]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for row in range(4):  # the squares on the diagonal: 1 + m_ii - m_jj - m_kk, and 1 + the trace
            parts[4 * i][5 * row] = 1.0 if row in (i, 3) else -1.0
        for entry, sign in ((3 * k + j, 1.0), (3 * j + k, -1.0)):  # m_kj - m_jk is 4 q_i w
            parts[entry][4 * i + 3] = parts[entry][12 + i] = sign
            parts[entry][4 * j + k] = parts[entry][4 * k + j] = 1.0
    return tuple(tuple(row) for row in parts)


_SHEPPERD = _shepperd()
_ONES = tuple(tuple(1.0 if i == j else 0.0 for j in range(4)) for i in range(4))


def _last(x: Any, i: int) -> Any:
    return x[..., i : i + 1]


def _length(v: Any) -> Any:
    xp = namespace(v)
    return xp.sqrt(xp.sum(v * v, axis=-1, keepdims=True) + _TINY)


def vec_normalize(v: Array) -> Array:
    """Unit vectors. `v` [..., N] -> [..., N]."""
    return v / _length(v)


def vec_cross(a: Array, b: Array) -> Array:
    """Cross product. [..., 3] x [..., 3] -> [..., 3]."""
    xp = namespace(a, b)
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    return xp.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def quat_identity(array: Array, shape: tuple[int, ...] = ()) -> Array:
    """Identity quaternions [*shape, 4] of the kind of `array`."""
    xp = namespace(array)
    one = like([0.0, 0.0, 0.0, 1.0], array)
    return xp.broadcast_to(one, (*shape, 4)) + 0.0 * one


def quat_normalize(q: Array) -> Array:
    """Unit quaternions. [..., 4] -> [..., 4]."""
    return vec_normalize(q)


def quat_mul(a: Array, b: Array) -> Array:
    """Hamilton product: first `b`, then `a`. [..., 4] x [..., 4] -> [..., 4].

    In few operations: batches are small here, and each costs microseconds however little it does.
    """
    xp = namespace(a, b)
    placed = xp.take(a, indices(_PLACES, a), axis=-1)
    matrix = xp.reshape(placed, (*a.shape[:-1], 4, 4)) * constant(_SIGNS, a)
    return xp.sum(matrix * b[..., None, :], axis=-1)


def quat_inv(q: Array) -> Array:
    """Inverse of unit quaternions. [..., 4] -> [..., 4]."""
    return q * constant(_CONJUGATE, q)


def quat_rotate(q: Array, v: Array) -> Array:
    """Rotates vectors. `q` [..., 4], `v` [..., 3] -> [..., 3]."""
    axis, w = q[..., :3], _last(q, 3)
    t = 2.0 * vec_cross(*_broadcast(axis, v))
    return v + w * t + vec_cross(*_broadcast(axis, t))


def _broadcast(a: Any, b: Any) -> Any:
    xp = namespace(a, b)
    if is_torch_namespace(xp):  # torch works out common shapes in Python, and imports sympy for it
        return xp.broadcast_tensors(a, b)
    return xp.broadcast_arrays(a, b)


def quat_from_rotvec(v: Array) -> Array:
    """Exponential map: rotation vectors [rad] [..., 3] -> [..., 4]."""
    xp = namespace(v)
    angle = _length(v)
    return xp.concat([v * (xp.sin(angle / 2) / angle), xp.cos(angle / 2)], axis=-1)


def quat_to_rotvec(q: Array) -> Array:
    """Logarithm, the shorter way round: [..., 4] -> rotation vectors [rad] [..., 3], lengths in [0, pi]."""
    xp = namespace(q)
    q = xp.where(_last(q, 3) < 0, -q, q)
    sine = _length(q[..., :3])
    angle = 2 * xp.atan2(sine, _last(q, 3))
    return q[..., :3] * (angle / sine)


def quat_from_matrix(m: Array) -> Array:
    """Rotation matrices [..., 3, 3] -> [..., 4].

    Shepperd's method ("Quaternion from rotation matrix", 1978): four exact formulas, each good where its own component
    is large; one product gives all four, and the one with the largest component is taken.
    """
    xp = namespace(m)
    entries: Any = xp.reshape(m, (*m.shape[:-2], 9))
    formulas: Any = constant(_SHEPPERD, m)
    # Broadcast, so that the product of one posture has the same bits in every batch.
    formulas = xp.broadcast_to(formulas, (*entries.shape[:-2], *formulas.shape))
    rows = xp.reshape(entries @ formulas, (*m.shape[:-2], 4, 4)) + constant(_ONES, m)
    best, largest = rows[..., 0, :], rows[..., 0, :1]
    for i in range(1, 4):
        own = rows[..., i, i : i + 1]
        best, largest = xp.where(own > largest, rows[..., i, :], best), xp.maximum(own, largest)
    return quat_normalize(best)


def quat_from_axes(x: Array, y: Array, z: Array) -> Array:
    """Quaternions of the rotation matrix with these columns. Three [..., 3] -> [..., 4]."""
    return quat_from_matrix(namespace(x).stack([x, y, z], axis=-1))


def quat_to_matrix(q: Array) -> Array:
    """[..., 4] -> rotation matrices [..., 3, 3]."""
    xp = namespace(q)
    products = xp.reshape(q[..., :, None] * q[..., None, :], (*q.shape[:-1], 16))
    return xp.reshape(products @ constant(_SQUARES, q), (*q.shape[:-1], 3, 3)) + constant(_IDENTITY, q)


def quat_from_6d(d: Array) -> Array:
    """Forward axis (image of +Z) and up axis (image of +Y), orthonormalised. [..., 6] -> [..., 4]."""
    z = vec_normalize(d[..., :3])
    x = vec_normalize(vec_cross(d[..., 3:], z))
    return quat_from_axes(x, vec_cross(z, x), z)


def quat_to_6d(q: Array) -> Array:
    """Forward axis then up axis: continuous, so networks can learn it. [..., 4] -> [..., 6]."""
    m = quat_to_matrix(q)
    return namespace(q).concat([m[..., 2], m[..., 1]], axis=-1)


def quat_nlerp(a: Array, b: Array, t: Any) -> Array:
    """Normalised linear interpolation, the shorter way round. `t` broadcasts to [..., 1]."""
    xp = namespace(a, b)
    dot = xp.sum(a * b, axis=-1, keepdims=True)
    return quat_normalize(a * (1.0 - t) + xp.where(dot < 0, -b, b) * t)


def quat_slerp(a: Array, b: Array, t: Any) -> Array:
    """Spherical interpolation, the shorter way round. `t` broadcasts to [..., 1]."""
    return quat_mul(quat_from_rotvec(quat_to_rotvec(quat_mul(b, quat_inv(a))) * t), a)


def quat_between(u: Array, v: Array) -> Array:
    """The smallest rotation that turns direction `u` into `v`, any normal if opposite. Two [..., 3] -> [..., 4]."""
    xp = namespace(u, v)
    u, v = vec_normalize(u), vec_normalize(v)
    cosine = xp.sum(u * v, axis=-1, keepdims=True)
    normal = vec_cross(*_broadcast(u, v))
    # Half turn: any axis square to u will do; take the one from the coordinate axis least aligned with u.
    least = xp.where(xp.abs(_last(u, 0)) < 0.7, like([1.0, 0.0, 0.0], u), like([0.0, 1.0, 0.0], u))
    aside = vec_normalize(vec_cross(*_broadcast(u, least)))
    opposite = cosine < -1 + 1e-6
    axis = xp.where(opposite, aside, normal)
    return quat_normalize(xp.concat([axis, xp.where(opposite, 0.0 * cosine, 1 + cosine)], axis=-1))


def quat_from_yaw(yaw: Array) -> Array:
    """Turn about +Y [rad]; yaw 0 faces +Z. [...] -> [..., 4]."""
    xp = namespace(yaw)
    zero = 0.0 * yaw
    return xp.stack([zero, xp.sin(yaw / 2), zero, xp.cos(yaw / 2)], axis=-1)


def quat_yaw(q: Array) -> Array:
    """Yaw of the rotated +Z axis [rad]. [..., 4] -> [...]."""
    xp = namespace(q)
    x, y, z, w = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    return xp.atan2(2 * (x * z + y * w), 1 - 2 * (x * x + y * y))


def yaw_direction(yaw: Array) -> Array:
    """Unit vectors on the floor that a yaw faces: (sin, 0, cos). [...] -> [..., 3]."""
    xp = namespace(yaw)
    return xp.stack([xp.sin(yaw), 0.0 * yaw, xp.cos(yaw)], axis=-1)


def angle_wrap(angle: Array) -> Array:
    """The same angle in (-pi, pi] [rad]."""
    xp = namespace(angle)
    return xp.atan2(xp.sin(angle), xp.cos(angle))


def quat_angle(a: Array, b: Array) -> Array:
    """Angle between two rotations [rad]. [..., 4] x [..., 4] -> [...]."""
    return _length(quat_to_rotvec(quat_mul(a, quat_inv(b))))[..., 0]
