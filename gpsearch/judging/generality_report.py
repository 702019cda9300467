"""Train beside test, for programs and for readers."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from fitters.judging.metrics import IMAGE_METRICS
from gpsearch.judging.generality import COMPARED, ERROR, IMAGES, Scored
from gpsearch.judging.scenes import NamedScene
from gpsearch.judging.transfers import REFERENCES
from gpsearch.run.result import FOUND

SHORT = {"cook-torrance": "CT", "ggx": "GGX"}


@dataclass(frozen=True, eq=False)
class Generality:
    """Models of a run on the materials of its search (`train`) and on others (`test`), by name.

    member: the one whose materials are listed; None where nothing was found
    """

    run: str
    scene: NamedScene
    metric: str
    train: tuple[str, ...]
    test: tuple[str, ...]
    models: Sequence[Scored]
    member: Scored | None

    @property
    def references(self) -> dict[str, Scored]:
        by_name = {one.contender.entry.name: one for one in self.models}
        return {name: by_name[name] for name in REFERENCES}

    @property
    def sets(self) -> dict[str, tuple[str, ...]]:
        return {"train": self.train, "test": self.test}


# for programs


def generality_json(report: Generality) -> dict[str, Any]:
    """Plain objects; what could not be fitted is null."""
    return {
        "run": report.run,
        "scene": {"name": report.scene.name, **asdict(report.scene.scene)},
        "metric": report.metric,
        "materials": list(report.train),
        "test_materials": list(report.test),
        "metrics": {
            ERROR: {
                "unit": "",
                "better": "lower",
                "protocol": f"the {report.metric} metric over three channels",
            },
            **{name: IMAGE_METRICS[name].describe() for name in IMAGES},
        },
        "models": [_model_json(report, one) for one in report.models],
        "member": report.member and _member_json(report, report.member),
    }


def _model_json(report: Generality, one: Scored) -> dict[str, Any]:
    entry = one.contender.entry
    below = {
        name: {metric: one.mean_below(reference, report.test, metric) for metric in COMPARED}
        for name, reference in report.references.items()
    }
    return {
        "name": entry.name,
        "kind": entry.kind,
        "expression": entry.expression,
        "nodes": entry.nodes,
        "floats": entry.floats,
        "error": entry.error,
        "test_error": entry.test_error,
        "train": {metric: one.mean(report.train, metric) for metric in (ERROR, *IMAGES)},
        "test": {metric: one.mean(report.test, metric) for metric in (ERROR, *IMAGES)} | {"below": below},
        "materials": {name: dict(scores) for name, scores in one.scores.items()},
        "warnings": list(one.contender.warnings),
    }


def _member_json(report: Generality, member: Scored) -> dict[str, Any]:
    return {
        "id": member.contender.entry.name,
        "expression": member.contender.entry.expression,
        "nodes": member.contender.entry.nodes,
        "figures": {
            metric: {
                name: {
                    "materials": {material: _row(report, member, [material], metric) for material in materials},
                    "average": _row(report, member, materials, metric),
                }
                for name, materials in report.sets.items()
            }
            for metric in ("l2", "1-ssim", ERROR)
        },
    }


def _row(report: Generality, member: Scored, materials: Sequence[str], metric: str) -> dict[str, Any]:
    """A line of a figure: means over materials, and how far the member lies below the references."""
    references = report.references
    return {
        **{name: reference.mean(materials, metric) for name, reference in references.items()},
        "new": member.mean(materials, metric),
        "below": {name: member.mean_below(reference, materials, metric) for name, reference in references.items()},
    }


# for readers


def generality_text(report: Generality) -> str:
    """The table of all models, and that of the member by material."""
    tables = [_models_text(report)] + ([_member_text(report, report.member)] if report.member else [])
    return "\n".join(line.rstrip() for line in "\n\n".join(tables).splitlines())


def _models_text(report: Generality) -> str:
    width = max(len(_name(one)) for one in report.models)
    lines = [
        f"{report.run}: train, {len(report.train)} materials of the search, beside test,"
        f" {len(report.test)} others, under {report.scene.name}; means over materials",
        "below refitted CT (Cook-Torrance), GGX: 1 - new / reference on the test materials",
        "",
        f"{'':{width}s} nodes   {_centred(f'error ({report.metric})', 15)}"
        + "".join(f"   {_centred(IMAGE_METRICS[name].label, 15)}" for name in ("l2", "1-ssim"))
        + "".join(f"   {_centred(f'below {SHORT[name]}', 20)}" for name in REFERENCES),
        f"{'':{width}s}      "
        + 3 * f"   {'train':>7s} {'test':>7s}"
        + 2 * f"   {'error':>6s} {'L2':>6s} {'1-SSIM':>6s}",
    ]
    return "\n".join([*lines, *(_model_line(report, one, width) for one in report.models)])


def _name(one: Scored) -> str:
    return f"found {one.contender.entry.name}" if one.contender.entry.kind == FOUND else one.contender.entry.name


def _model_line(report: Generality, one: Scored, width: int) -> str:
    text = f"{_name(one):{width}s} {one.contender.entry.nodes or '-':>5}"
    for metric in COMPARED:
        text += f"   {_number(one.mean(report.train, metric))} {_number(one.mean(report.test, metric))}"
    for reference in report.references.values():
        text += "  "
        for metric in COMPARED:
            text += f" {_percent(one.mean_below(reference, report.test, metric))}"
    return text


def _member_text(report: Generality, member: Scored) -> str:
    """The figures side by side, as the paper has them."""
    figures, entry = ("l2", "1-ssim", ERROR), member.contender.entry
    width = 2 + max(map(len, (*report.train, *report.test, "training set")))
    titles = {name: IMAGE_METRICS[name].label for name in IMAGES} | {ERROR: f"error ({report.metric})"}
    columns = " ".join(f"{title:>7s}" for title in (*SHORT.values(), "new"))
    columns += "".join(f" {f'<{title}':>6s}" for title in SHORT.values())
    lines = [
        f"found {entry.name}, {entry.nodes} nodes: {entry.expression}",
        "new: this formula; <CT, <GGX: how far it lies below the refitted references; averages are means",
        "",
        f"{'':{width}s}" + "".join(f"   {_centred(titles[metric], len(columns))}" for metric in figures),
        f"{'':{width}s}" + f"   {columns}" * len(figures),
    ]
    for title, materials in (("training set", report.train), ("testing set", report.test)):
        rows = [(name, [name]) for name in materials] + [("average", list(materials))]
        lines.append(title)
        for name, group in rows:
            cells = (_cells(_row(report, member, group, metric)) for metric in figures)
            lines.append(f"  {name:{width - 2}s}" + "".join(f"   {cell}" for cell in cells))
    return "\n".join(lines)


def _cells(row: dict[str, Any]) -> str:
    values = " ".join(_number(row[name]) for name in (*REFERENCES, "new"))
    return values + "".join(f" {_percent(row['below'][name])}" for name in REFERENCES)


def _centred(text: str, width: int) -> str:
    return f"{text:^{width}s}"


def _number(value: float | None) -> str:
    return f"{'-':>7s}" if value is None else f"{value:7.4f}" if value < 99 else f"{value:7.1f}"


def _percent(value: float | None) -> str:
    """Six characters; what is ten times as bad as the reference is no more than that."""
    if value is None:
        return f"{'-':>6s}"
    return f"{100 * value:5.1f}%" if value > -1 else f"{100 * value:5.0f}%" if value > -10 else "<-999%"
