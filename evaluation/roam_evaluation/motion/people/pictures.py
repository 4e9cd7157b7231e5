"""Filmstrips and short videos of what the product does, and nameless sheets that mix it with captured people.

    roam evaluate motion --people --draw docs/pictures/motion --objects DIR [--mocap DIR]

For every scene a sheet NAME.png (seen from the side and from the front, time runs to the right) and a video NAME.webp.
With captured clips also mixed-NAME.png, whose rows are in random order; mixed-key.json tells which are whose.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from roam_motion.animator import Animator

from roam_evaluation.goalpose.inputs.objects import find_objects
from roam_evaluation.motion.goals import SeatGoal, make_goals
from roam_evaluation.motion.people import performed
from roam_evaluation.motion.people.bodies import ABOVE, FRONT, SIDE, picture
from roam_evaluation.motion.people.captured import Captured
from roam_evaluation.motion.people.frames import RATE, Motion
from roam_evaluation.motion.people.measures import lying, sitting, standing, turning, walking
from roam_evaluation.shared.picture import Splats, cloud_splats, contact_sheet, object_splats

SEAT, BED = "chair_polyhaven_dining-chair-02", "bed_polyhaven_gothic-bed-01"
SCENES = ("start", "walk", "stop", "run", "turn-180", "sit", "seated", "rise", "lie", "get-up", "mixed")
_MOMENTS = 12  # of a filmstrip
_SIZE, _SPAN = 170, 2.3  # [px], [m] of a picture
_FILM_SIZE, _FILM_RATE = 200, 15.0  # [px], [Hz]
_QUALITIES = (70, 50, 35, 20)  # of a video, until it is small enough
_MOST = 400_000  # [bytes] of a file
_ROWS = 8  # of a mixed sheet


@dataclass(frozen=True, eq=False)
class Scene:
    """What is drawn: frames of a motion, with the object it is about."""

    name: str
    motion: Motion
    goal: SeatGoal | None = None

    @property
    def views(self) -> dict[str, tuple[float, float]]:
        """Names of the two views, azimuth against the facing and elevation; boards hide who lies from the side."""
        lies = self.goal is not None and self.goal.action == "lie"
        return {"front": FRONT, "above": ABOVE} if lies else {"side": SIDE, "front": FRONT}


def draw(
    animator: Animator,
    objects: Sequence[Path],
    poses: Path | None,
    folder: Path,
    captured: Captured | None,
    *,
    films: bool,
    only: Sequence[str] = (),
) -> None:
    """All pictures into a folder; the videos, which take the longest, if `films`."""
    folder.mkdir(parents=True, exist_ok=True)
    wanted = set(only) if only else set(SCENES)
    scenes = walked(animator) if wanted & set(SCENES[:5]) else []
    scenes += seated(animator, objects, poses, "sit", SEAT) if wanted & set(SCENES[5:8]) else []
    scenes += seated(animator, objects, poses, "lie", BED) if wanted & set(SCENES[8:10]) else []
    for scene in (one for one in scenes if one.name in wanted):
        strip(scene, folder / f"{scene.name}.png")
        if films:
            film(scene, folder / f"{scene.name}.webp")
        print(f"{scene.name}: {len(scene.motion) / RATE:.1f} s", flush=True)
    if captured is not None and "mixed" in wanted:
        mixed_sheets(animator, objects, poses, captured, folder)


def walked(animator: Animator) -> list[Scene]:
    """Start, walk, stop, run and a turn by 180 degrees."""
    scripts = [*performed.steered((1.2, 2.8), [3]), *performed.on_the_spot((180,), [3])]
    walk, run, turn = performed.perform(animator, scripts)
    begin, end = performed.GOING.start, performed.GOING.stop
    return [
        Scene("start", walk.cut(begin - 10, begin + 50)),
        Scene("walk", walk.cut(begin + 120, begin + 192)),
        Scene("stop", walk.cut(end - 20, end + 70)),
        Scene("run", run.cut(begin + 120, begin + 165)),
        Scene("turn-180", turn.cut(35, 145)),
    ]


def seated(animator: Animator, objects: Sequence[Path], poses: Path | None, action: str, name: str) -> list[Scene]:
    """Sitting down, ten seconds of sitting and rising; or lying down and getting up."""
    found = [
        item for item in find_objects(objects, (), categories=None if action == "sit" else {"bed"}) if item.name == name
    ]
    goals = make_goals(found, action=action, remembered=poses)
    if not goals:
        print(f"{name} is not in the folders of objects: no pictures of how to {action}")
        return []
    (motion,) = performed.approaches(animator, goals, 1, seed=4)
    if not motion.stretches:
        print(f"{name} was not reached: no pictures of how to {action}")
        return []
    held = motion.stretches[0]
    leave = held.last + 1
    if action == "lie":
        parts = {
            "lie": (_before_lying(motion), held.first + 20),
            "get-up": (leave - 5, min(leave + 240, len(motion) - 1)),
        }
    else:
        (sit,) = sitting.sits(motion)
        way = sitting.way_down(sit)
        first = (way.begun if way else held.first - 40) - 40
        last = min(held.first + 300, held.last)
        parts = {"sit": (first, held.first + 30), "seated": (held.first, last), "rise": (leave - 5, leave + 100)}
    return [Scene(key, motion.cut(max(a, 0), min(b, len(motion) - 1)), goals[0]) for key, (a, b) in parts.items()]


def _before_lying(motion: Motion) -> int:
    (lie,) = lying.held(motion)
    return max(lie.first - 170, 0)


def _scenery(scene: Scene) -> list[Splats]:
    if scene.goal is None:
        return []
    shape = scene.goal.shape
    found = (
        object_splats(*shape.mesh, count=30_000)
        if shape.mesh is not None
        else cloud_splats(shape.points, shape.normals)
    )
    return [Splats(found.points - np.array([0, shape.floor_height, 0]), found.normals, found.colours)]


def _yaw(motion: Motion) -> float:
    """The heading that the side view looks across."""
    return float(np.median(motion.facing))


def strip(scene: Scene, path: Path) -> None:
    """Moments from the side and from the front."""
    motion, scenery, yaw = scene.motion, _scenery(scene), _yaw(scene.motion)
    moments = np.linspace(0, len(motion) - 1, _MOMENTS).round().astype(int)
    cells = []
    for view, (azimuth, elevation) in scene.views.items():
        for moment in moments:
            frame = motion.positions[moment]
            pixels = picture(frame, (yaw + azimuth, elevation), _centre(frame), size=_SIZE, span=_SPAN, scene=scenery)
            cells.append((f"{view} {moment / RATE:.2f} s", pixels))
    contact_sheet(cells, columns=_MOMENTS).quantize(96).save(path, optimize=True)


def _centre(frame: np.ndarray) -> np.ndarray:
    return np.array([frame[0, 0], 0.86, frame[0, 2]])


def film(scene: Scene, path: Path) -> None:
    """A video in real time, from the side and from the front; the camera goes along."""
    motion, scenery, yaw = scene.motion, _scenery(scene), _yaw(scene.motion)
    frames = []
    rate = _FILM_RATE if len(motion) < 5 * RATE else _FILM_RATE / 2
    for moment in np.arange(0, len(motion) - 1, RATE / rate).round().astype(int):
        frame = motion.positions[moment]
        views = [
            picture(frame, (yaw + azimuth, elevation), _centre(frame), size=_FILM_SIZE, span=_SPAN, scene=scenery)
            for azimuth, elevation in scene.views.values()
        ]
        frames.append(Image.fromarray(np.concatenate(views, axis=1)))
    for quality in _QUALITIES:
        duration = round(1000 / rate)
        frames[0].save(
            path, save_all=True, append_images=frames[1:], duration=duration, loop=0, quality=quality, method=4
        )
        if path.stat().st_size <= _MOST:
            return
    print(f"{path.name} is larger than {_MOST // 1000} kB")


def mixed_sheets(
    animator: Animator, objects: Sequence[Path], poses: Path | None, captured: Captured, folder: Path
) -> None:
    """Nameless sheets: half of the rows ours, half captured (CMU only, whose licence lets pictures go anywhere)."""
    people = [m for m in captured.held_out if m.name.startswith("cmu_")]
    kept = [m for m in captured.training if m.name.startswith("cmu_")]
    ours = performed.perform(animator, [*performed.steered((0.9,), range(4)), *performed.on_the_spot((135,), range(4))])
    goals = make_goals(find_objects(objects, (), categories=None)[::5], action="sit", remembered=poses)
    ours += performed.approaches(animator, goals, 4) if goals else []
    key = {}
    for name, find in {"walk": _walks, "turn": _turns, "sit": _sits, "stop": _stops}.items():
        made, real = ([part for m in group for part in find(m)[:2]] for group in (ours, [*people, *kept]))
        if made and real:
            key[name] = _mixed(made, real, folder / f"mixed-{name}.png")
    (folder / "mixed-key.json").write_text(json.dumps(key, indent=1) + "\n")


def _walks(motion: Motion) -> list[Motion]:
    return [w.cut(0, 60) for w in walking.windows(motion, (0.7, 1.1))]


def _turns(motion: Motion) -> list[Motion]:
    return [turn.motion for turn in turning.turns(motion) if abs(turn.angle) > np.radians(80)]


def _sits(motion: Motion) -> list[Motion]:
    found = []
    for sit in sitting.sits(motion):
        way = sitting.way_down(sit)
        if way is not None and 0.3 < sitting.seat_height(sit) < 0.6:
            found.append(motion.cut(max(way.begun - 20, 0), min(way.touch + 30, len(motion) - 1)))
    return found


def _stops(motion: Motion) -> list[Motion]:
    return [motion.cut(max(t - 40, 0), min(t + 30, len(motion) - 1)) for t in standing.stops(motion)]


def _mixed(made: Sequence[Motion], real: Sequence[Motion], path: Path) -> list[str]:
    """One sheet; returns whose each row is, from the top."""
    random = np.random.default_rng(7)
    half = _ROWS // 2
    rows = [("ours", m) for m in _some(made, half, random)] + [("captured", m) for m in _some(real, half, random)]
    rows = [rows[i] for i in random.permutation(len(rows))]
    cells = []
    for number, (_, motion) in enumerate(rows):
        for moment in np.linspace(0, len(motion) - 1, _MOMENTS).round().astype(int):
            frame, yaw = motion.positions[moment], motion.facing[len(motion) // 2]
            pixels = picture(frame, (yaw + SIDE[0] - 0.5, SIDE[1]), _centre(frame), size=130, span=_SPAN)
            cells.append((f"{number + 1}" if moment == 0 else "", pixels))
    contact_sheet(cells, columns=_MOMENTS).quantize(96).save(path, optimize=True)
    return [whose for whose, _ in rows]


def _some(motions: Sequence[Motion], count: int, random: np.random.Generator) -> list[Motion]:
    return [motions[i] for i in random.permutation(len(motions))[:count]]
