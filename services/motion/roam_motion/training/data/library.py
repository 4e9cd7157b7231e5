"""From folders of BVH to the training and validation sets: recordings cut into episodes, balanced, cached.

Left and right are exchanged when a batch is learned from (mirror.py), not here.
"""

import hashlib
import json
from collections import defaultdict
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from roam_character.clip import Clip

from roam_motion.animation.figure import Figure
from roam_motion.animation.state import FRAME_RATE
from roam_motion.training.data.balance import GOING, TAKING, balanced, kinds_of_going, kinds_of_taking
from roam_motion.training.data.dataset import Dataset, build
from roam_motion.training.data.episodes import Episode, locomotion, lying
from roam_motion.training.data.goals import Bank, Key, at_origin, read_given
from roam_motion.training.data.licences import licence_of
from roam_motion.training.data.recordings import Recording, Span, read_folder
from roam_motion.training.data.sitting import Passage, passages, sitting

_LEAST_HIPS = {"sit": 0.40, "lie": 0.30}  # [m] lower held hips are on the floor, not on furniture
_CHAIR = 0.38, 0.58  # [m] seat heights of ordinary chairs
_HIPS_OVER_SEAT = 0.145  # [m]
_TEMPO = 0.85, 1.1  # captured ways down and up are played so many times as fast
_TRIES = 3  # goals tried for an episode until one suits
_VERSION = 6  # of the cached form
_OWN_HELD_OUT = (
    *("mm_", "acted_014", "genuine_014", "running_1_test"),
    *("113_15", "14_28", "14_32", "13_05", "19_12", "22_03", "111_10"),
    *("15_0", "104_", "41_0", "16_33", "82_09", "69_70", "132_45", "137_29", "139_28"),
)


@dataclass(frozen=True)
class LibraryConfig:
    """How the data are prepared; part of the cache key."""

    folders: tuple[str, ...]
    goals: str | None = None  # folder of goal poses that the goal-pose service made
    seed: int = 0
    goals_per_sit: int = 20  # goal poses that every captured way down and way up is brought to
    goals_per_lie: int = 8
    interaction_share: float = 0.55  # of drawn frames; captured share is about a tenth
    lie_share: float = 0.12  # of the drawn interaction frames
    held_out: tuple[str, ...] = _OWN_HELD_OUT  # beginnings of file names, beside those of HELDOUT.txt
    share_alike: bool = False  # clips under CC BY-SA are asked for; the weights are then under that licence


def load_library(figure: Figure, config: LibraryConfig, cache: Path) -> tuple[Dataset, Dataset, dict[str, object]]:
    """Training set, validation set (held-out clips), and a report. Cached under `cache` by configuration.

    Raises LicenceError for share-alike clips that were not asked for.
    """
    licence = licence_of(config.folders, allowed=config.share_alike)
    given = sorted(path.name for path in Path(config.goals).glob("*.json")) if config.goals else []
    held_out = held_out_names(config)
    key = hashlib.sha256(json.dumps([asdict(config), given, held_out, _VERSION]).encode()).hexdigest()[:12]
    paths = [cache / f"{key}-{name}.pt" for name in ("train", "validation")]
    report_path = cache / f"{key}-report.json"
    if all(p.exists() for p in (*paths, report_path)):
        return Dataset.load(paths[0]), Dataset.load(paths[1]), json.loads(report_path.read_text())
    train, validation, report = _prepare(figure, config, held_out)
    report["licence"] = licence
    cache.mkdir(parents=True, exist_ok=True)
    train.save(paths[0])
    validation.save(paths[1])
    report_path.write_text(json.dumps(report, indent=1))
    return train, validation, report


def held_out_names(config: LibraryConfig) -> tuple[str, ...]:
    """Beginnings of the names of clips that are not trained on: the configuration's, and those that a HELDOUT.txt in
    a clip folder or beside it lists, one a line."""
    names = list(config.held_out)
    for folder in map(Path, config.folders):
        for path in (folder / "HELDOUT.txt", folder.parent / "HELDOUT.txt"):
            if path.is_file():
                lines = [line.split("#")[0].strip() for line in path.read_text().splitlines()]
                names += [line for line in lines if line]
    return tuple(dict.fromkeys(names))


def _prepare(
    figure: Figure, config: LibraryConfig, names: tuple[str, ...]
) -> tuple[Dataset, Dataset, dict[str, object]]:
    recordings: list[Recording] = []
    rejects = []
    for folder in config.folders:
        found, bad = read_folder(Path(folder), figure.skeleton)
        recordings += found
        rejects += bad
    if not recordings:
        raise ValueError(f"no usable BVH files in {', '.join(config.folders)}")
    recordings = [_without_floor_spans(r) for r in recordings]
    held_out = [r for r in recordings if is_held_out(r.name, names)]
    kept = [r for r in recordings if not is_held_out(r.name, names)]
    rng = np.random.default_rng(config.seed)
    train, train_report = _episodes(figure, kept, config, rng, copies=1.0)
    validation, validation_report = _episodes(figure, held_out or kept, config, rng, copies=0.25)
    report: dict[str, object] = {
        "recordings": len(recordings),
        "minutes": round(sum(r.clip.duration for r in recordings) / 60, 1),
        "rejects": [{"file": r.path.name, "reason": r.reason} for r in rejects],
        "held_out": sorted(r.name for r in held_out),
        "train": train_report,
        "validation": validation_report,
    }
    return train, validation, report


def is_held_out(name: str, names: tuple[str, ...]) -> bool:
    """Whether a recording (`folder/stem`) is not for training: compositions name their parts in the middle."""
    stem = name.split("/")[-1]
    return any(stem.startswith(own) or f"_on_{own}" in stem for own in names)


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
) -> tuple[Dataset, dict[str, object]]:
    banks = _banks(figure, recordings, config)
    walks = [
        episode
        for recording in recordings
        if not recording.name.startswith("derived")
        for episode in locomotion(recording.at_rate(FRAME_RATE), figure.skeleton)
    ]
    made = {
        "sit": _sits(figure, recordings, banks["sit"], max(1, round(config.goals_per_sit * copies)), rng),
        "lie": _lies(recordings, banks, max(1, round(config.goals_per_lie * copies)), rng),
    }
    episodes, weights, shares = _balanced(walks, made, config)
    minutes = {k: round(sum(len(e.clip) for e in v) / FRAME_RATE / 60, 1) for k, v in {"walk": walks, **made}.items()}
    report: dict[str, object] = {"episodes": len(episodes), **minutes, "shares_percent": shares}
    report["sits_at_chair_height_percent"] = _at_chair_height(made["sit"])
    return build(figure, episodes, weights), report


def _sits(
    figure: Figure, recordings: list[Recording], bank: Bank, goals: int, rng: np.random.Generator
) -> list[Episode]:
    """Every good way down with any way up, and every good way up with any way down, at so many goals each; of clips
    without a single good one all ways, such as they are."""
    spans = [(r, span) for r in recordings for span in r.spans if span.action == "sit"]
    good = any(passages(r, span) for r, span in spans)
    made: list[Episode] = []
    for _ in range(goals):
        found = [way for r, span in spans for way in passages(r, span, float(rng.uniform(*_TEMPO)), good=good)]
        downs, ups = [w for w in found if not w.up], [w for w in found if w.up]
        pairs = [(down, _any(ups, rng)) for down in downs] + [(_any(downs, rng), up) for up in ups]
        for down, up in pairs:
            tried = (sitting(figure.skeleton, down, up, bank, rng, good=good) for _ in range(_TRIES))
            episode = next((e for e in tried if e is not None), None)
            if episode is not None:
                made.append(episode)
    return made


def _any(ways: list[Passage], rng: np.random.Generator) -> Passage | None:
    return ways[rng.integers(len(ways))] if ways else None


def _lies(recordings: list[Recording], banks: dict[str, Bank], goals: int, rng: np.random.Generator) -> list[Episode]:
    made: list[Episode] = []
    for recording in recordings:
        for number, span in enumerate(recording.spans):
            for _ in range(goals if span.action == "lie" else 0):
                timed = recording.at_rate(FRAME_RATE, speed=float(rng.uniform(0.9, 1.2)))
                episode = lying(timed, timed.spans[number], banks, rng)
                if episode is not None:
                    made.append(episode)
    return made


def _banks(figure: Figure, recordings: list[Recording], config: LibraryConfig) -> dict[str, Bank]:
    """Held key poses of every span, and their mirror images, and given goal poses, by action."""
    captured: dict[str, list[Key]] = {"sit": [], "lie": []}
    for recording in recordings:
        for span in recording.spans:
            for clip in (recording.clip, recording.clip.mirrored()):
                captured[span.action] += _held_keys(figure, clip, span)
    folder = Path(config.goals) if config.goals else None
    return {
        action: Bank(keys, read_given(figure.skeleton, folder, action) if folder else [])
        for action, keys in captured.items()
    }


def _held_keys(figure: Figure, clip: Clip, span: Span) -> list[Key]:
    frames = sorted({span.first, (span.first + span.last) // 2, span.last})
    return [at_origin(figure.skeleton, Key(clip.root_positions[t], clip.rotations[t])) for t in frames]


def _balanced(
    walks: list[Episode], made: dict[str, list[Episode]], config: LibraryConfig
) -> tuple[list[Episode], list[np.ndarray], dict[str, float]]:
    """All episodes, sits first (goal rows must exist), with weights per frame that give each kind its share; and those
    shares [percent]."""
    lie = config.lie_share if made["lie"] else 0.0
    taking = config.interaction_share if made["sit"] or made["lie"] else 0.0
    groups = {
        "sit": (made["sit"], taking * (1 - lie if made["sit"] else 0.0), TAKING),
        "lie": (made["lie"], taking * (lie if made["sit"] else 1.0), TAKING),
        "": (walks, 1 - taking if walks else 0.0, GOING),
    }
    episodes: list[Episode] = []
    weights: list[np.ndarray] = []
    shares: dict[str, float] = defaultdict(float)
    for name, (group, share, names) in groups.items():
        kinds = [(kinds_of_taking if name else kinds_of_going)(episode) for episode in group]
        own = [share * w for w in balanced(kinds, names)]
        for kind, weight in zip(kinds, own, strict=True):
            for number in np.unique(kind):
                label = f"{name}: {list(names)[number]}" if name else list(names)[number]
                shares[label] += float(weight[kind == number].sum())
        episodes += group
        weights += own
    whole = max(sum(shares.values()), 1e-9)
    return episodes, weights, {label: round(100 * share / whole, 1) for label, share in shares.items()}


def _at_chair_height(sits: list[Episode]) -> float:
    heights = np.array([e.goals[0][0].hips[1] - _HIPS_OVER_SEAT for e in sits])
    return round(100 * float(((heights > _CHAIR[0]) & (heights < _CHAIR[1])).mean()), 1) if len(sits) else 0.0
