"""`gpsearch materials FILE...`: what is in measured materials."""

from dataclasses import asdict

import click

from fitters.materials import FORMATS, MaterialSummary, builtin_names, load_material, summarise
from gpsearch.commands.runs import json_option, print_json

_KINDS = ", ".join(f"{form.name} {form.suffix}" for form in FORMATS if not form.anisotropic)


@click.command(
    help=f"Prints what is in FILES: {_KINDS}, or builtin:NAME. Without FILES, the names of the built-in materials."
)
@click.argument("files", nargs=-1)
@json_option
def materials(files: tuple[str, ...], as_json: bool) -> None:
    if not files:
        names = [f"builtin:{name}" for name in builtin_names()]
        print_json({"builtin": names}) if as_json else click.echo("\n".join(names))
        return
    summaries = [summarise(load_material(reference)) for reference in files]
    if as_json:
        print_json({"materials": [asdict(summary) for summary in summaries]})
    else:
        click.echo("\n\n".join(map(_text, summaries)))


def _text(summary: MaterialSummary) -> str:
    def triple(values: tuple[float, ...], form: str) -> str:
        return "  ".join(form.format(value) for value in values)

    lines = [
        f"{summary.name} ({summary.source})",
        f"  cells        {summary.cells:,}; {summary.above_horizon:,} above the horizon, {summary.valid:,} valid",
        f"  invalid      {summary.invalid_share:.2%} of those above the horizon",
        f"  negative     {triple(summary.negative_share, '{:.2%}')}  of the valid, set to 0 (R G B)",
        f"  range        {triple(summary.minimum, '{:.3g}')}  to  {triple(summary.maximum, '{:.4g}')}  sr^-1",
        f"  median       {triple(summary.median, '{:.3g}')}  sr^-1",
    ]
    lines += [f"  albedo {d.theta_i:3.0f} deg  {triple(d.albedo, '{:.3f}')}" for d in summary.directional_albedo]
    lines.append(f"  albedo (sky)   {triple(summary.hemispherical_albedo, '{:.3f}')}")
    if summary.gains_energy:
        lines.append("  an albedo exceeds 1: the measurement gains energy")
    return "\n".join(lines)
