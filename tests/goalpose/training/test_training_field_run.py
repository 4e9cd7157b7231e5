"""A training run learns, leaves its records, stops on a signal and goes on where it stopped."""

import csv
import json
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from roam_goalpose.field import Field, FieldConfig
from roam_goalpose.furniture import generate
from roam_goalpose.training.batches import Source, draw
from roam_goalpose.training.evaluate_field import by_category, main, occupancy_ious, score_store
from roam_goalpose.training.field import Run, TrainingConfig, parse, read_config
from roam_goalpose.training.publish import card_section, publish, replace_section
from roam_goalpose.training.store import Store, open_or_write, procedural_examples

SMALL = FieldConfig(anchors=32, channels=8, scalars=8, shared=4, frame=8, hidden=16, encoder_blocks=1, decoder_blocks=1)


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    folder = tmp_path_factory.mktemp("data") / "procedural"
    return open_or_write(folder, 4, lambda: procedural_examples(4, seed=0, categories=("chair", "sofa")))


@pytest.fixture
def config(tmp_path: Path) -> TrainingConfig:
    return TrainingConfig(out=str(tmp_path / "run"), minutes=0.02, batch=4, queries=64, network=SMALL)


def test_batch_labels_survive_augmentation(store: Store) -> None:
    """Stretched and mirrored queries still lie where their labels say: inside points are enclosed by the cloud."""
    batch = draw([Source(store, 1.0, 1.25)], np.random.default_rng(0), size=8, queries=256)
    assert batch.points.shape[0] == 8
    assert batch.points.shape[1] >= 500
    assert torch.equal(batch.inside > 0, batch.distance < 0)
    nearest = torch.cdist(batch.queries, batch.points).amin(-1)
    assert nearest[batch.inside > 0].median() < nearest[batch.inside == 0].median()
    assert torch.allclose(batch.place[..., 0], batch.queries[..., 0].abs(), atol=1e-6)


def test_same_seed_same_batch(store: Store) -> None:
    first, second = (draw([Source(store, 1.0, 1.25)], np.random.default_rng(7), size=2, queries=8) for _ in range(2))
    assert torch.equal(first.points, second.points)
    assert torch.equal(first.queries, second.queries)


def test_loss_falls(store: Store, config: TrainingConfig) -> None:
    run, random = Run(config), np.random.default_rng(0)
    batch = draw([Source(store, 1.0, 1.0)], random, size=4, queries=256)
    losses = [sum(run.one_step(batch).values()) for _ in range(200)]
    assert losses[-1] < 0.7 * losses[0]


def test_run_leaves_records_and_resumes(store: Store, config: TrainingConfig) -> None:
    sources = [Source(store, 1.0, 1.1)]
    first = Run(config)
    for _ in range(50):
        first.one_step(draw(sources, np.random.default_rng(0), size=2, queries=16))
    first.train(sources, {"procedural": store})
    folder = Path(config.out)
    assert read_config(folder) == config
    assert Field.load(folder / "field.safetensors").config == SMALL
    assert json.loads((folder / "scores.jsonl").read_text().splitlines()[-1])["all"]["objects"] == 4
    second = Run(config, resume=True)
    assert second.step == first.step
    assert second.seconds == first.seconds
    for old, new in zip(first.field.parameters(), second.field.parameters(), strict=True):
        assert torch.equal(old, new)


def test_a_run_of_so_many_steps_ends_after_them_whatever_the_minutes(store: Store, config: TrainingConfig) -> None:
    run = Run(replace(config, minutes=0.0, steps=3))
    run.train([Source(store, 1.0, 1.1)], {})
    assert run.step == 3
    assert parse(["--procedural-only", "--steps", "7"])[0].steps == 7


def test_some_categories_of_a_store(store: Store) -> None:
    chairs = store.only(["chair"])
    rows = [row for row, category in enumerate(store.categories) if category == "chair"]
    assert 0 < len(chairs) < len(store)
    assert set(chairs.categories) == {"chair"}
    assert np.array_equal(chairs.surface, store.surface[rows])


def test_curves_have_one_line_per_report(store: Store, config: TrainingConfig) -> None:
    run = Run(replace(config, minutes=10.0))
    sources = [Source(store, 1.0, 1.1)]
    step = run.one_step

    def fifty_then_signal(batch: object) -> dict[str, float]:
        if run.step == 50:
            signal.raise_signal(signal.SIGTERM)
        return step(batch)  # type: ignore[arg-type]

    run.one_step = fifty_then_signal  # type: ignore[method-assign]
    old = signal.getsignal(signal.SIGTERM), signal.getsignal(signal.SIGINT)
    try:
        run.train(sources, {})
    finally:
        signal.signal(signal.SIGTERM, old[0])
        signal.signal(signal.SIGINT, old[1])
    assert run.step == 51
    assert (run.folder / "checkpoint.pt").exists()
    with (run.folder / "curves.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["step"] for row in rows] == ["50"]


def test_scores() -> None:
    distance = torch.tensor([-0.05, -0.01, 0.01, 0.05])
    perfect = distance < 0
    assert occupancy_ious(perfect, perfect, distance)[:2] == (1.0, 1.0)
    shifted = torch.tensor([True, True, True, False])  # one centimetre too fat
    plain, tolerant, _ = occupancy_ious(shifted, shifted, distance)
    assert plain == pytest.approx(2 / 3)
    assert tolerant == 1.0
    wrong = torch.tensor([True, True, False, True])  # five centimetres too fat
    assert occupancy_ious(wrong, wrong, distance)[1] == pytest.approx(2 / 3)


def test_untrained_field_scores_low_and_by_category(store: Store) -> None:
    torch.manual_seed(0)
    table = by_category(score_store(Field(SMALL), store, queries=500))
    assert table["all"]["objects"] == 4
    assert 0.0 <= table["all"]["iou"] < 0.6


def test_evaluation_writes_its_report(
    config: TrainingConfig, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Field(SMALL).save(tmp_path / "field.safetensors")
    (tmp_path / "meshes").mkdir()
    generate("stool", 1).to_trimesh().export(tmp_path / "meshes" / "stool_one.glb")
    report = tmp_path / "report.json"
    options = [
        "--weights",
        str(tmp_path / "field.safetensors"),
        "--objects",
        str(tmp_path / "meshes"),
        "--procedural",
        "1",
    ]
    assert main([*options, "--json", str(report)]) == 0
    shapes = json.loads(report.read_text())["shapes"]
    assert shapes["meshes"]["stool"]["objects"] == 1
    assert shapes["procedural"]["all"]["objects"] == 1
    assert "stool" in capsys.readouterr().out


def test_command_line() -> None:
    config, resume = parse(["--procedural-only", "--minutes", "5", "--seed", "3", "--categories", "chair", "sofa"])
    assert not resume
    assert (config.minutes, config.seed, config.categories, config.objects) == (5.0, 3, ("chair", "sofa"), ())


def test_a_run_can_begin_with_published_weights(tmp_path: Path) -> None:
    weights = tmp_path / "field.safetensors"
    torch.manual_seed(3)
    published = Field(SMALL)
    published.save(weights)
    config, resume = parse(["--procedural-only", "--init", str(weights), "--out", str(tmp_path / "run")])
    assert not resume
    assert config.network == SMALL
    assert config.rate < TrainingConfig(out="").rate
    run = Run(config)
    for mine, theirs in zip(run.averaged.parameters(), published.parameters(), strict=True):
        assert torch.equal(mine, theirs)
    assert read_config(run.folder) == config


def test_publishing_replaces_its_own_section_only() -> None:
    card = "# Model card\n\n## Descriptor field\n\nold\n\n## Motion\n\nkept\n"
    changed = replace_section(card, "## Descriptor field\n\nnew\n")
    assert "old" not in changed
    assert changed.index("new") < changed.index("kept")
    assert replace_section("", "## Descriptor field\n").startswith("# Model card")


def test_published_files_match_the_manifest(store: Store, config: TrainingConfig, tmp_path: Path) -> None:
    from hashlib import sha256

    run = Run(replace(config, objects=(), procedural=4, data=str(tmp_path / "data"), categories=("stool",)))
    run.checkpoint([Source(store, 1.0, 1.1)])
    (tmp_path / "data").mkdir()
    for name in ("procedural-stool-4", "procedural-stool-held-out"):
        open_or_write(tmp_path / "data" / name, 2, lambda: procedural_examples(2, seed=5, categories=("stool",)))
    weights = tmp_path / "weights"
    weights.mkdir()
    (weights / "manifest.json").write_text('{"motion.safetensors": {"file": "motion.safetensors"}}')
    entry = publish(run.folder, weights)
    manifest = json.loads((weights / "manifest.json").read_text())
    assert set(manifest) == {"motion.safetensors", "field.safetensors"}
    assert entry["sha256"] == sha256((weights / "field.safetensors").read_bytes()).hexdigest()
    assert card_section(entry) in (weights / "MODEL_CARD.md").read_text()
