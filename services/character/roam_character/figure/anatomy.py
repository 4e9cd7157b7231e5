"""The figure's body as implicit solids, in the T-pose of our humanoid skeleton (+Y up, facing +Z) [m].

Girths are those of a slim adult of 1.69 m; tuned by eye on renders from four sides,
standing and sitting.
"Left" solids are mirrored for the right. A station is x, y, z, half width, half depth.
"""

from math import cos, sin

from roam_character.figure.solids import (
    Solid,
    blend,
    capsule,
    carve,
    common,
    ellipsoid,
    half_space,
    mirrored,
    seen_from_front,
    sweep,
    thicker,
)

SHOULDER = (0.155, 1.3755, -0.035)
ELBOW = (0.43, 1.3755, -0.035)
WRIST = (0.675, 1.3755, -0.035)
HIP = (0.09, 0.9005, 0.0)
KNEE = (0.09, 0.5005, 0.0)
ANKLE = (0.09, 0.0805, 0.0)
_EYE = (0.0305, 1.5935, 0.0755)
BALL = (0.09, 0.0255, 0.125)  # the joint of the toes


def torso() -> Solid:
    """Pelvis, belly, chest and the slope of the shoulders."""
    trunk = sweep([
        (0, 0.865, -0.012, 0.105, 0.085),
        (0, 0.905, -0.014, 0.158, 0.106),
        (0, 0.960, -0.012, 0.156, 0.106),
        (0, 1.030, -0.004, 0.137, 0.095),
        (0, 1.090, 0.000, 0.127, 0.089),
        (0, 1.170, 0.000, 0.136, 0.096),
        (0, 1.260, -0.002, 0.152, 0.106),
        (0, 1.330, -0.010, 0.150, 0.098),
        (0, 1.385, -0.020, 0.116, 0.072),
        (0, 1.425, -0.024, 0.068, 0.056),
    ])  # fmt: skip
    chest = ellipsoid((0.062, 1.285, 0.066), (0.070, 0.062, 0.036), tilt=0.25)
    blades = ellipsoid((0.075, 1.285, -0.085), (0.060, 0.085, 0.028), tilt=-0.1)
    seat = ellipsoid((0.070, 0.905, -0.072), (0.076, 0.072, 0.052))
    return blend([trunk, *_both(chest), *_both(blades), *_both(seat)], 0.045)


def shoulder_girdle() -> Solid:
    """From the neck to the shoulder, left."""
    top = capsule((0.030, 1.414, -0.030), (0.150, 1.380, -0.035), 0.040, 0.040)
    side = capsule((0.060, 1.330, -0.020), (0.135, 1.348, -0.032), 0.062, 0.050)
    slope = capsule((0.020, 1.452, -0.034), (0.085, 1.404, -0.036), 0.026, 0.036)
    return blend([top, side, slope], 0.04)


def upper_arm() -> Solid:
    """Left."""
    x, y, z = SHOULDER
    return sweep([
        (x - 0.004, y - 0.004, z, 0.048, 0.046),
        (x + 0.060, y - 0.003, z, 0.048, 0.050),
        (x + 0.140, y - 0.001, z + 0.003, 0.043, 0.046),
        (x + 0.215, y + 0.000, z, 0.038, 0.041),
        (ELBOW[0], y, z - 0.002, 0.036, 0.038),
    ], across=(0, 0, 1))  # fmt: skip


def forearm() -> Solid:
    """Left, with the wrist flat as it is when the palm looks down."""
    x, y, z = ELBOW
    return sweep([
        (x, y, z - 0.002, 0.0360, 0.0370),
        (x + 0.055, y, z + 0.001, 0.0405, 0.0385),
        (x + 0.120, y, z, 0.0360, 0.0335),
        (x + 0.190, y, z, 0.0295, 0.0245),
        (WRIST[0] - 0.012, y, z, 0.0270, 0.0200),
        (WRIST[0] + 0.012, y, z, 0.0270, 0.0185),
    ], across=(0, 0, 1))  # fmt: skip


# Base (from the wrist: forward, up, towards the thumb), length of the three bones, radius at base and tip [m].
_FINGERS = (
    ((0.090, 0.000, 0.0300), (0.036, 0.022, 0.018), 0.0096, 0.0074),
    ((0.094, 0.002, 0.0100), (0.039, 0.024, 0.019), 0.0098, 0.0074),
    ((0.090, 0.001, -0.0095), (0.036, 0.023, 0.019), 0.0093, 0.0071),
    ((0.082, -0.002, -0.0275), (0.028, 0.018, 0.017), 0.0084, 0.0065),
)
_CURL = (0.16, 0.30, 0.24)  # [rad] a hand at rest: each bone bends so much further
_SPREAD = (0.10, 0.03, -0.03, -0.11)  # [rad]


def hand() -> Solid:
    """Left, palm down, fingers a little bent."""
    wrist = WRIST
    palm = sweep([
        (wrist[0] - 0.006, wrist[1], wrist[2], 0.0250, 0.0180),
        (wrist[0] + 0.022, wrist[1] - 0.001, wrist[2] + 0.002, 0.0300, 0.0170),
        (wrist[0] + 0.055, wrist[1] - 0.001, wrist[2] + 0.002, 0.0390, 0.0160),
        (wrist[0] + 0.084, wrist[1] - 0.001, wrist[2] + 0.001, 0.0395, 0.0130),
    ], across=(0, 0, 1))  # fmt: skip
    ball = capsule(_from_wrist(0.022, -0.006, 0.016), _from_wrist(0.056, -0.010, 0.038), 0.0155, 0.0130)
    fingers = [_finger(*row, spread) for row, spread in zip(_FINGERS, _SPREAD, strict=True)]
    return blend([blend([palm, ball], 0.018), _union(fingers), _thumb()], 0.008)


def _from_wrist(forward: float, up: float, thumb: float) -> tuple[float, float, float]:
    return (WRIST[0] + forward, WRIST[1] + up, WRIST[2] + thumb)


def _finger(base: tuple[float, ...], lengths: tuple[float, ...], radius: float, tip: float, spread: float) -> Solid:
    forward, up, thumb = base
    points, angle = [_from_wrist(forward - 0.02, up, thumb - 0.02 * spread), _from_wrist(*base)], 0.0
    for length, bend in zip(lengths, _CURL, strict=True):
        angle += bend
        forward += length * cos(angle) * cos(spread)
        up -= length * sin(angle)
        thumb += length * cos(angle) * sin(spread)
        points.append(_from_wrist(forward, up, thumb))
    girths = (radius, radius, radius * 0.97, (radius + tip) / 2, tip)
    bones = zip(points[:-1], points[1:], girths[:-1], girths[1:], strict=True)
    return blend([capsule(a, b, r, s) for a, b, r, s in bones], 0.003)


def _thumb() -> Solid:
    points = [_from_wrist(*p) for p in ((0.030, -0.006, 0.022), (0.060, -0.012, 0.046), (0.084, -0.017, 0.058),
                                        (0.106, -0.022, 0.064))]  # fmt: skip
    girths = (0.0140, 0.0115, 0.0105, 0.0082)
    return blend([capsule(points[i], points[i + 1], girths[i], girths[i + 1]) for i in range(3)], 0.004)


def _union(solids: list[Solid]) -> Solid:
    return blend(solids, 0.0035)


def thigh() -> Solid:
    """Left."""
    x, y, z = HIP
    return sweep([
        (x + 0.004, y - 0.010, z - 0.010, 0.079, 0.088),
        (x + 0.002, y - 0.090, z - 0.004, 0.075, 0.083),
        (x - 0.002, y - 0.190, z + 0.004, 0.066, 0.073),
        (x - 0.002, y - 0.300, z + 0.003, 0.054, 0.059),
        (x, KNEE[1] + 0.030, z + 0.002, 0.049, 0.053),
        (x, KNEE[1] - 0.010, z + 0.001, 0.047, 0.050),
    ])  # fmt: skip


def shank() -> Solid:
    """Left: knee and calf."""
    x, y, z = KNEE
    return sweep([
        (x, y + 0.010, z + 0.002, 0.047, 0.050),
        (x, y - 0.060, z - 0.006, 0.046, 0.050),
        (x, y - 0.130, z - 0.014, 0.048, 0.052),
        (x, y - 0.220, z - 0.011, 0.041, 0.044),
        (x, y - 0.320, z - 0.004, 0.031, 0.034),
        (x, ANKLE[1] + 0.010, z - 0.004, 0.029, 0.034),
        (x, ANKLE[1] - 0.020, z - 0.002, 0.030, 0.036),
    ])  # fmt: skip


def foot() -> Solid:
    """Left, in a shoe: heel, instep, ball; the sole is cut flat elsewhere."""
    x = ANKLE[0]
    body = sweep([
        (x, 0.040, -0.038, 0.034, 0.040),
        (x, 0.050, 0.005, 0.036, 0.050),
        (x + 0.002, 0.046, 0.050, 0.039, 0.046),
        (x + 0.003, 0.034, 0.100, 0.045, 0.035),
        (x + 0.002, 0.026, 0.145, 0.045, 0.028),
        (x - 0.004, 0.020, 0.180, 0.036, 0.023),
    ])  # fmt: skip
    collar = sweep([(x, 0.060, -0.010, 0.040, 0.046), (x, 0.105, -0.010, 0.037, 0.043)])
    return blend([body, collar], 0.03)


def neck() -> Solid:
    """From between the shoulders into the skull."""
    column = sweep([
        (0, 1.350, -0.030, 0.070, 0.058),
        (0, 1.420, -0.026, 0.060, 0.056),
        (0, 1.460, -0.016, 0.052, 0.053),
        (0, 1.520, -0.006, 0.049, 0.053),
        (0, 1.560, 0.000, 0.048, 0.053),
    ])  # fmt: skip
    return column


def head() -> Solid:
    """Skull, face, nose, lips and ears; the eyes lie in hollows."""
    skull = ellipsoid((0, 1.603, -0.004), (0.0735, 0.0830, 0.0930))
    face = sweep([
        (0, 1.632, 0.030, 0.064, 0.060),
        (0, 1.590, 0.032, 0.062, 0.058),
        (0, 1.550, 0.034, 0.054, 0.051),
        (0, 1.521, 0.044, 0.036, 0.036),
    ])  # fmt: skip
    cheek = ellipsoid((0.036, 1.567, 0.062), (0.026, 0.026, 0.024))
    jaw = capsule((0.048, 1.545, 0.002), (0.022, 1.513, 0.062), 0.017, 0.014)
    chin = ellipsoid((0, 1.511, 0.074), (0.020, 0.015, 0.015))
    whole = blend([skull, face, *_both(cheek), *_both(jaw), chin], 0.030)
    brow = capsule((0.010, 1.6105, 0.0870), (0.042, 1.6090, 0.0750), 0.0090, 0.0080)
    whole = blend([whole, *_both(brow)], 0.016)
    hollow = ellipsoid((0.0305, 1.5935, 0.0990), (0.0190, 0.0115, 0.0150))
    for tool in _both(hollow):
        whole = carve(whole, tool, 0.014)
    lids = common(ellipsoid(_EYE, (0.0140, 0.0137, 0.0137)), half_space((0, 1.5968, 0.0800), (0, -1, 0.15)))
    whole = blend([whole, *_both(lids)], 0.004)
    whole = blend([whole, _nose(), *_both(_ear())], 0.0075)
    return blend([whole, common(thicker(whole, 0.0022), mouth(), radius=0.002)], 0.002)


def _nose() -> Solid:
    bridge = capsule((0, 1.603, 0.0870), (0, 1.5665, 0.1080), 0.0070, 0.0092)
    wing = ellipsoid((0.0095, 1.5625, 0.0985), (0.0080, 0.0075, 0.0095))
    return blend([bridge, *_both(wing)], 0.009)


def mouth() -> Solid:
    """Where the lips are, seen from the front; `upper_lip` and `lower_lip` are its parts."""
    return blend([upper_lip(), lower_lip()], 0.001)


def upper_lip() -> Solid:
    """A slim bow under the nose."""
    return seen_from_front([(-0.0225, 1.5362, 0.0012), (-0.006, 1.5400, 0.0036), (0, 1.5392, 0.0034),
                            (0.006, 1.5400, 0.0036), (0.0225, 1.5362, 0.0012)], 0.05)  # fmt: skip


def lower_lip() -> Solid:
    """Fuller and shorter than the upper one."""
    return seen_from_front([(-0.0195, 1.5346, 0.0012), (-0.007, 1.5318, 0.0040), (0.007, 1.5318, 0.0040),
                            (0.0195, 1.5346, 0.0012)], 0.05)  # fmt: skip


def _ear() -> Solid:
    shell = ellipsoid((0.0745, 1.5830, -0.010), (0.0085, 0.0300, 0.0180), tilt=0.2)
    bowl = ellipsoid((0.0840, 1.5870, -0.006), (0.0060, 0.0170, 0.0090), tilt=0.2)
    return carve(shell, bowl, 0.004)


def eyeball() -> Solid:
    """Left."""
    return ellipsoid(_EYE, (0.0128, 0.0128, 0.0128))


def floor() -> Solid:
    """Everything above the ground of the T-pose."""
    return half_space((0, 0, 0), (0, -1, 0))


def _both(solid: Solid) -> list[Solid]:
    return [solid, mirrored(solid)]
