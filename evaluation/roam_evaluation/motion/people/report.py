"""The verdicts as a table to read and as JSON."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from roam_evaluation.motion.people.activities import Activity
from roam_evaluation.motion.people.blind import LIMIT, Blind
from roam_evaluation.motion.people.targets import Target
from roam_evaluation.motion.people.verdict import Spread, Verdict, summary


def as_json(verdicts: Sequence[Verdict]) -> list[dict[str, Any]]:
    """One record a measure, rounded."""
    return [
        {
            "activity": v.activity,
            "measure": v.measure.key,
            "title": v.measure.title,
            "unit": v.measure.unit,
            "definition": v.measure.definition,
            "source": v.measure.source,
            "people_stated": v.measure.stated,
            "judged": v.measure.judged,
            "product": _rounded(v.product),
            "people_held_out": _rounded(v.held_out),
            "people_training": _rounded(v.training),
            "judged_with": v.which,
            "outside_widths": None if v.outside is None else round(v.outside, 3),
        }
        for v in verdicts
    ]


def _rounded(found: Spread | None) -> dict[str, float] | None:
    return {key: round(value, 3) for key, value in asdict(found).items()} if found else None


def table(verdicts: Sequence[Verdict], activities: Sequence[Activity]) -> str:
    """Markdown: a table for every activity, then the summary."""
    lines: list[str] = []
    for activity in activities:
        mine = [v for v in verdicts if v.activity == activity.key]
        if mine:
            lines += ["", f"### {activity.title} — {_counts(mine)}", "", *_HEAD, *(_row(v) for v in mine)]
    total = summary(verdicts)
    lines += [
        "",
        f"**{total['inside']} of {total['measures']} medians inside people's 5-95 % ({total['inside_percent']} %), "
        f"{total['farther_than_half']} farther out than half a range, {total['not_measurable']} not measurable.**",
    ]
    return "\n".join(lines).lstrip("\n")


def targets_table(targets: Sequence[Target]) -> str:
    """Markdown table of figures that have limits of their own."""
    rows = [
        f"| {t.title} | {_short(t.value)} {t.unit} | {t.limit} | {'yes' if t.kept else '**no**'} |" for t in targets
    ]
    return "\n".join(["### Asked of the product", "", "| | product | asked | kept |", "|---|---|---|---|", *rows])


def blind_table(found: Sequence[Blind]) -> str:
    """Markdown table of the blind test."""
    rows = [
        f"| {b.kind} | {b.accuracy:.0f} % | {_percent(b.wide)} | <= {LIMIT:.0f} % | {_percent(b.control)} | "
        f"{b.product} of {b.seeds} seeds, {b.people} of {b.persons} persons |"
        for b in found
    ]
    head = (
        "| | product told from people, learned from held-out clips | from training clips too | asked "
        "| people told from other people | windows of 1 s |"
    )
    parts = [
        f"By one part of the body alone, {b.kind}: "
        + ", ".join(f"{part} {x:.0f} %" for part, x in b.parts.items())
        + "."
        for b in found
    ]
    return "\n".join(["### Blind test (50 % is guessing)", "", head, "|---|---|---|---|---|---|", *rows, "", *parts])


def _percent(value: float | None) -> str:
    return "–" if value is None else f"{value:.0f} %"


_HEAD = (
    "| | product 5 / 50 / 95 % | people, held out | people, training clips | verdict |",
    "|---|---|---|---|---|",
)


def _counts(verdicts: Sequence[Verdict]) -> str:
    made = max((v.product.samples for v in verdicts if v.product), default=0)
    held = max((v.held_out.samples for v in verdicts if v.held_out), default=0)
    kept = max((v.training.samples for v in verdicts if v.training), default=0)
    persons = max((v.held_out.persons for v in verdicts if v.held_out), default=0)
    others = max((v.training.persons for v in verdicts if v.training), default=0)
    return f"{made} of the product, {held} held out of {persons} persons, {kept} others of {others}"


def _row(v: Verdict) -> str:
    unit = f" [{v.measure.unit}]" if v.measure.unit else ""
    return f"| {v.measure.title}{unit} | {_cell(v.product)} | {_cell(v.held_out)} | {_cell(v.training)} | {_words(v)} |"


def _cell(found: Spread | None) -> str:
    return "–" if found is None else " / ".join(_short(x) for x in (found.low, found.median, found.high))


def _short(value: float) -> str:
    size = abs(value)
    return f"{value:.0f}" if size >= 20 else f"{value:.1f}" if size >= 2 else f"{value:.2f}"


def _words(v: Verdict) -> str:
    if not v.measure.judged:
        return "(told)"
    if v.people is None:
        return "no people to compare with"
    mark = "" if v.which == "held-out" else " †"
    if v.outside is None:
        return f"NOT MEASURABLE{mark}"
    return f"inside{mark}" if v.inside else f"**OUT by {max(v.outside, 0.01):.2f}**{mark}"
