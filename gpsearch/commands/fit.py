"""`gpsearch fit MODEL MATERIAL...`: fits a catalogue formula, an expression or a baseline."""

import os
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from fitters.expressions import to_text
from fitters.fitting import RESIDUALS, Problem
from fitters.grid import CHANNELS
from fitters.materials import is_anisotropic
from fitters.models import MODELS, Fitted, fitter_of
from fitters.models.formula import PUBLISHED
from fitters.scenes import Scene
from gpsearch.commands.runs import json_option, print_json

TABLES = [name for name, fitter in MODELS.items() if fitter.family is not PUBLISHED]
SOLVED = [name for name, fitter in MODELS.items() if fitter.solvers]
SOLVERS = list(dict.fromkeys(solver for fitter in MODELS.values() for solver in fitter.solvers))

HELP = f"""Fits MODEL to MATERIALs and says how well it explains them under a light.

MODEL is a published formula, an expression over p0.., or one of {", ".join(TABLES)}. Formulas are fitted to
all materials together, the others to each alone. power-iterations-anisotropic also takes UTIA .bin files.

\b
Arrays of a saved file, red green blue last, f in sr^-1:
  npf-*             f = rho_d + rho_s D(theta_h) F(theta_d) G(theta_i) G(theta_o)
                    / (cos theta_i cos theta_o); npf-naive: H(phi_d) instead of G and cosines
    D (90, 3)       bins of theta_h, the middle of bin i at (i + 1/2)^2 / 90 degrees
    F (90, 3)       bins of theta_d, the middle of bin i at i + 1/2 degrees
    G (90, 3)       at 0, 1, .. 89 degrees, linear between; beyond, G and cosine are those at 89
    H (180, 3)      bins of phi_d, the middle of bin i at i + 1/2 degrees
  bivariate         f = B(theta_h, theta_d), B (90, 90, 3), the bins of D and F
  power-iterations  P, D and quantiles Q at theta, G1 at theta_k, F (90, 3) at theta_d;
                    anisotropic: P, D, G1 over phi first, Q1 and Q2 for Q. Radians.
  formulas          expression, parameters (3, k) for p0, p1, .. in their order
"""


@click.command(help=HELP)
@click.argument("model")
@click.argument("materials", nargs=-1, required=True)
@click.option("--light", default="studio", show_default=True, help="studio, overcast, or a .hdr or .exr map.")
@click.option("--metric", type=click.Choice(list(RESIDUALS)), default="light", show_default=True)
@click.option(
    "--solver",
    type=click.Choice(SOLVERS),
    help="For npf-*: all factors jointly (the default), or the paper's AWLS.",
)
@click.option("--save", type=click.Path(path_type=Path), help="A .npz file for the arrays fitted to one material.")
@json_option
@click.pass_context
def fit(
    context: click.Context,
    model: str,
    materials: tuple[str, ...],
    light: str,
    metric: str,
    solver: str | None,
    save: Path | None,
    as_json: bool,
) -> None:
    fitter = fitter_of(model)
    if solver is not None and not fitter.solvers:
        raise click.UsageError(f"--solver: {model} has none to choose; {', '.join(SOLVED)} have.")
    if save is not None:
        _check_target(save, materials)
    anisotropic = any(map(is_anisotropic, materials))
    if anisotropic:
        _refuse_given(context, ("light", "metric"))
    problem = Problem(materials, Scene(light=light), metric=metric)
    fitted = fitter.fit(problem, **({"solver": solver} if solver else {}))
    if save is not None:
        fitted.save(save)
    if as_json:
        print_json(_report(fitted, {} if anisotropic else {"scene": light}))
        return
    click.echo(_text(fitted))
    for warning in fitted.warnings:
        click.echo(f"warning: {warning}", err=True)


def _report(fitted: Fitted, scene: dict[str, str]) -> dict[str, Any]:
    expression = fitted[fitted.materials[0]].expression
    details = {name: dict(fit.details) for name, fit in fitted.fits.items() if fit.details}
    return {
        "model": fitted.name,
        **({"expression": to_text(expression)} if expression else {}),
        "materials": list(fitted.materials),
        **({"material": fitted.materials[0]} if len(fitted.materials) == 1 else {}),
        **scene,
        "metric": fitted.metric,
        "fit_seconds": round(fitted.fit_seconds, 3),
        "floats": fitted.floats,
        "warnings": list(fitted.warnings),
        "error": fitted.error,
        "errors": fitted.errors,
        **({"parameters": fitted.parameters} if expression else {}),
        "metrics": fitted.metrics,
        **({"fits": details} if len(details) > 1 else next(iter(details.values()), {})),
    }


def _text(fitted: Fitted) -> str:
    expression = fitted[fitted.materials[0]].expression
    size = f"{fitted.fit_seconds:.2f} s, {fitted.floats:,} floats"
    lines = [f"{fitted.name}: {fitted.metric} error {fitted.error:.4f}, {size}"]
    if expression:
        lines.append(f"  {to_text(expression)}")
    for name, fit in fitted.fits.items():
        rows = zip(CHANNELS, fitted.errors[name], fit.remarks, strict=True)
        channels = [f"  {channel:5s}  error {error:.4f}  {remark}".rstrip() for channel, error, remark in rows]
        lines += [name, *channels, *(f"  {note}" for note in fit.notes)]
    return "\n".join(lines)


def _check_target(path: Path, materials: tuple[str, ...]) -> None:
    """Refuses a file that cannot be written while nothing has been fitted for it yet."""
    if len(materials) > 1:
        raise click.UsageError(
            f"--save keeps what is fitted to one material, not to {len(materials)}: fit each in its own command."
        )
    if path.suffix != ".npz":
        raise click.UsageError(
            f"--save {path}: a file of arrays ends in .npz, such as {path.with_suffix('.npz')}."
        )
    if path.is_dir():
        raise click.UsageError(f"--save {path}: this is a folder; name a file in it.")
    if not path.parent.is_dir():
        raise click.UsageError(f"--save {path}: there is no folder {path.parent}; make it first.")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise click.UsageError(f"--save {path}: this may not be written here; choose another place.")


def _refuse_given(context: click.Context, names: tuple[str, ...]) -> None:
    for name in names:
        if context.get_parameter_source(name) is not ParameterSource.DEFAULT:
            raise click.UsageError(f"--{name}: .bin files are judged over their own samples, without a light.")
