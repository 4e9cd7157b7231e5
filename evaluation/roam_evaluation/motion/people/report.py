"""The verdicts as a table to read and as JSON."""

import json
from collections.abc import Mapping, Sequence
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


def as_text(report: Mapping[str, Any]) -> str:
    """A report as JSON with one line a record, so that two of them can be compared by lines."""
    parts = []
    for name, value in report.items():
        if isinstance(value, list):
            rows = ",\n".join(f"  {json.dumps(record, ensure_ascii=False)}" for record in value)
            parts.append(f' "{name}": [\n{rows}\n ]' if value else f' "{name}": []')
        else:
            parts.append(f' "{name}": {json.dumps(value)}')
    return "{\n" + ",\n".join(parts) + "\n}"


def _rounded(found: Spread | None) -> dict[str, float] | None:
    return {key: round(value, 3) for key, value in asdict(found).items()} if found else None


def table(verdicts: Sequence[Verdict], activities: Sequence[Activity], beside: Mapping[str, Any] | None = None) -> str:
    """Markdown: a table for every activity, then the summary. `beside` is the report of another build, whose medians
    get a column."""
    lines: list[str] = []
    other = {(m["activity"], m["measure"]): m for m in (beside or {}).get("measures", ())}
    for activity in activities:
        mine = [v for v in verdicts if v.activity == activity.key]
        if mine:
            lines += ["", f"### {activity.title}", "", _counts(mine, other), "", *_head(bool(other))]
            lines += [_row(v, other) for v in mine]
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


Other = Mapping[tuple[str, str], Mapping[str, Any]]


def _head(beside: bool) -> tuple[str, str]:
    names = ["product 5 / 50 / 95 %", "people, held out", "people, training clips", "verdict"]
    names[:0] = ["build beside"] if beside else []
    return "| | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"


def _counts(verdicts: Sequence[Verdict], other: Other) -> str:
    def most(part: str, what: str) -> int:
        found = [getattr(v, part) for v in verdicts]
        return max((getattr(one, what) for one in found if one), default=0)

    judged = [v for v in verdicts if v.measure.judged and v.people]
    old = [other.get((v.activity, v.measure.key), {}) for v in judged]
    before = sum(record.get("outside_widths") == 0 for record in old)
    beside = f" (build beside: {before})" if other else ""
    held, kept = (f"{most(part, 'samples')} {{}} of {most(part, 'persons')}" for part in ("held_out", "training"))
    samples = f"{most('product', 'samples')} of the product, {held.format('held out')} persons, {kept.format('others')}"
    return f"{sum(v.inside for v in judged)} of {len(judged)} inside{beside}. {samples}."


def _row(v: Verdict, other: Other) -> str:
    unit = f" [{v.measure.unit}]" if v.measure.unit else ""
    cells = [_cell(v.product), _cell(v.held_out), _cell(v.training), _words(v)]
    if other:
        made = other.get((v.activity, v.measure.key), {}).get("product")
        cells.insert(0, _short(made["median"]) if made else "–")
    return f"| {v.measure.title}{unit} | " + " | ".join(cells) + " |"


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
