"""From folders of BVH to the training and validation sets: recordings, mirrored, cut into episodes, balanced,
cached."""

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from roam_motion.animation.figure import Figure
from roam_motion.animation.state import FRAME_RATE
from roam_motion.training.dataset import Dataset, build
from roam_motion.training.episodes import Episode, interaction, locomotion
from roam_motion.training.goals import Bank, Key, at_origin, read_given
from roam_motion.training.recordings import Recording, read_folder

_LEAST_HIPS = {"sit": 0.40, "lie": 0.30}  # [m] lower held hips are on the floor, not on furniture
_VERSION = 4  # of the cached form


@dataclass(frozen=True)
class LibraryConfig:
    """How the data are prepared; part of the cache key."""

    folders: tuple[str, ...]
    goals: str | None = None  # folder of goal poses that the goal-pose service made
    seed: int = 0
    goals_per_sit: int = 10  # warped copies of every captured sit, and as many of its mirror image
    goals_per_lie: int = 8
    interaction_share: float = 0.55  # of drawn frames; captured share is about a tenth
    lie_share: float = 0.25  # of the drawn interaction frames
    held_out: tuple[str, ...] = ("113_15", "14_32", "13_05", "15_0", "104_", "41_0")


def load_library(figure: Figure, config: LibraryConfig, cache: Path) -> tuple[Dataset, Dataset, dict[str, object]]:
    """Training set, validation set (held-out clips), and a report. Cached under `cache` by configuration."""
    given = sorted(path.name for path in Path(config.goals).glob("*.json")) if config.goals else []
    key = hashlib.sha256(json.dumps([asdict(config), given, _VERSION]).encode()).hexdigest()[:12]
    paths = [cache / f"{key}-{name}.pt" for name in ("train", "validation")]
    report_path = cache / f"{key}-report.json"
    if all(p.exists() for p in (*paths, report_path)):
        return Dataset.load(paths[0]), Dataset.load(paths[1]), json.loads(report_path.read_text())
    train, validation, report = _prepare(figure, config)
    cache.mkdir(parents=True, exist_ok=True)
    train.save(paths[0])
    validation.save(paths[1])
    report_path.write_text(json.dumps(report, indent=1))
    return train, validation, report


def _prepare(figure: Figure, config: LibraryConfig) -> tuple[Dataset, Dataset, dict[str, object]]:
    recordings: list[Recording] = []
    rejects = []
    for folder in config.folders:
        found, bad = read_folder(Path(folder), figure.skeleton)
        recordings += found
        rejects += bad
    if not recordings:
        raise ValueError(f"no usable BVH files in {', '.join(config.folders)}")
    recordings = [_without_floor_spans(r) for r in recordings]
    held_out = [r for r in recordings if _held_out(r, config)]
    kept = [r for r in recordings if not _held_out(r, config)]
    rng = np.random.default_rng(config.seed)
    train, train_report = _episodes(figure, kept, config, rng, copies=1.0)
    validation, validation_report = _episodes(figure, held_out or kept, config, rng, copies=0.25)
    report: dict[str, object] = {
        "recordings": len(recordings),
        "minutes": round(sum(r.clip.duration for r in recordings) / 60, 1),
        "rejects": [{"file": r.path.name, "reason": r.reason} for r in rejects],
        "train": train_report,
        "validation": validation_report,
    }
    return train, validation, report


def _held_out(recording: Recording, config: LibraryConfig) -> bool:
    return any(recording.name.split("/")[-1].startswith(name) for name in config.held_out)


def _without_floor_spans(recording: Recording) -> Recording:
    """Drops spans on the floor; their frames stay marked by their segment labels and are not used for walking."""
    kept = tuple(s for s in recording.spans if recording.clip.root_positions[s.first, 1] > _LEAST_HIPS[s.action])
    if len(kept) == len(recording.spans):
        return recording
    names = list(recording.segments or ["idle"] * len(recording.clip))
    for span in set(recording.spans) - set(kept):
        first, last = span.down or 0, span.up or len(names) - 1
        names[first : last + 1] = ["sit-on-floor"] * (last + 1 - first)
    return Recording(recording.name, recording.clip, recording.ankle_contacts, names, kept)


def _episodes(
    figure: Figure, recordings: list[Recording], config: LibraryConfig, rng: np.random.Generator, *, copies: float
) -> tuple[Dataset, dict[str, float]]:
    both = [*recordings, *(r.mirrored() for r in recordings)]
    banks = _banks(figure, both, config)
    walks = [
        e for r in both for e in locomotion(r.at_rate(FRAME_RATE), figure.skeleton) if not r.name.startswith("derived")
    ]
    made: dict[str, list[Episode]] = {"sit": [], "lie": []}
    for recording in both:
        for number, span in enumerate(recording.spans):
            count = config.goals_per_sit if span.action == "sit" else config.goals_per_lie
            for _ in range(max(1, round(count * copies))):
                episode = _one(recording, number, banks, rng)
                if episode is not None:
                    made[span.action].append(episode)
    episodes, weights = _balanced(walks, made, config)
    minutes = {k: round(sum(len(e.clip) for e in v) / FRAME_RATE / 60, 1) for k, v in {"walk": walks, **made}.items()}
    return build(figure, episodes, weights), {"episodes": len(episodes), **minutes}


def _one(recording: Recording, number: int, banks: dict[str, Bank], rng: np.random.Generator) -> Episode | None:
    timed = recording.at_rate(FRAME_RATE, speed=float(rng.uniform(0.9, 1.2)))
    return interaction(timed, timed.spans[number], banks, rng)


def _banks(figure: Figure, recordings: list[Recording], config: LibraryConfig) -> dict[str, Bank]:
    """Held key poses of every span and given goal poses, by action."""
    captured: dict[str, list[Key]] = {"sit": [], "lie": []}
    for recording in recordings:
        for span in recording.spans:
            for frame in {span.first, (span.first + span.last) // 2, span.last}:
                key = Key(recording.clip.root_positions[frame], recording.clip.rotations[frame])
                captured[span.action].append(at_origin(figure.skeleton, key))
    folder = Path(config.goals) if config.goals else None
    return {
        action: Bank(keys, read_given(figure.skeleton, folder, action) if folder else [])
        for action, keys in captured.items()
    }


def _balanced(
    walks: list[Episode], made: dict[str, list[Episode]], config: LibraryConfig
) -> tuple[list[Episode], list[float]]:
    """All episodes, sits first (goal rows must exist), with per-frame weights that give each kind its share."""
    shares = {
        "sit": config.interaction_share * (1 - (config.lie_share if made["lie"] else 0)),
        "lie": config.interaction_share * config.lie_share,
        "walk": 1 - config.interaction_share,
    }
    episodes: list[Episode] = []
    weights: list[float] = []
    for name, group in ({**made, "walk": walks}).items():
        frames = sum(len(e.clip) for e in group)
        episodes += group
        weights += [shares[name] / max(frames, 1)] * len(group)
    return episodes, weights
