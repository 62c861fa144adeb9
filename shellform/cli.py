"""The command line (contracts/run-folder.md). Large libraries are loaded by the command that needs them."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

import shellform
from shellform.errors import InputError, NotConverged

app = typer.Typer(
    name="shellform",
    help="Design bending-active gridshells as falsework for concrete shells.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

_STOPPED = 130

Scripts = Annotated[bool, typer.Option("--allow-scripts", help="Run builder scripts from outside the shipped surfaces.")]
Unit = Annotated[str | None, typer.Option(help="Unit of files that carry none: m, cm, mm, in, ft.")]


def main() -> None:
    """Runs the command line: status 0 done, 2 input refused, 3 no result, 130 stopped."""
    try:
        status = app(standalone_mode=False)  # typer turns Ctrl-C into a returned status
        if status == _STOPPED:
            raise KeyboardInterrupt
        sys.exit(status if isinstance(status, int) else 0)
    except InputError as error:
        _leave(f"refused: {error}", 2)
    except NotConverged as error:
        _leave(f"no result: {error}", 3)
    except (KeyboardInterrupt, typer.Abort):
        _leave("stopped; what was computed is kept, and the same command goes on from there", _STOPPED)
    except MemoryError:
        _leave("no result: the memory is full. Choose a larger spacing or fewer elements.", 3)
    except typer.Exit as stop:
        sys.exit(stop.exit_code)
    except Exception as error:  # click's usage errors carry their own exit code
        code = getattr(error, "exit_code", None)
        if code is None:
            raise
        said = getattr(error, "format_message", None)
        _leave(f"refused: {said() if said else error}", 2)


def _leave(message: str, status: int) -> None:
    print(f"shellform: {message}", file=sys.stderr)
    sys.exit(status)


def _version(asked: bool) -> None:
    if asked:
        from importlib.metadata import PackageNotFoundError, version

        print(f"shellform {shellform.__version__}")
        for name in ("numpy", "scipy", "numba", "cvxopt", "gmsh", "nlopt", "pyvista"):
            try:
                print(f"{name} {version(name)}")
            except PackageNotFoundError:
                print(f"{name} is missing")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show versions.")] = False,
) -> None:
    pass


@app.command()
def check(file: Annotated[Path, typer.Argument(help="A surface or a case file.")], unit: Unit = None, allow_scripts: Scripts = False) -> None:
    """Read a surface or case and report what it is."""
    from shellform.study.check import check_file

    for name, value in check_file(file, unit=unit, allow_scripts=allow_scripts).items():
        print(f"{name:>22}  {value}")


@app.command()
def net(
    surface: Annotated[Path, typer.Argument(help="A surface file or shipped builder script.")],
    spacing: Annotated[float, typer.Option(help="Distance between rods, m.")],
    output: Annotated[Path, typer.Option(help="Run folder.")],
    unit: Unit = None,
    angle: Annotated[str, typer.Option(help="Of the u rods against the x axis, degrees, or auto: with least bending and shear.")] = "0",
    gap: Annotated[float | None, typer.Option(help="Between the rods' axes, m (default: spacing / 27.5).")] = None,
    allow_scripts: Scripts = False,
) -> None:
    """Draw the Chebyshev net alone."""
    from shellform.study.check import net_alone

    report = _Progress()
    summary = net_alone(
        surface, output, spacing=spacing, unit=unit, angle=angle, gap=gap, allow_scripts=allow_scripts, report=report
    )
    report.close()
    for name, value in summary.items():
        print(f"{name:>22}  {value}")


@app.command()
def design(
    case: Annotated[Path, typer.Argument(help="Case file (TOML).")],
    output: Annotated[Path, typer.Option(help="Run folder.")],
    until: Annotated[str, typer.Option(help="Last stage: surface, net, initial, optimise or figures.")] = "figures",
    fresh: Annotated[bool, typer.Option("--fresh", help="Compute every stage anew.")] = False,
    settings: Annotated[list[str] | None, typer.Option("--set", help="KEY=VALUE in place of an entry.")] = None,
    allow_scripts: Scripts = False,
) -> None:
    """Run the whole job; run again, it goes on where it stopped."""
    from shellform.study.case import load_case
    from shellform.study.run import run_case

    report = _Progress()
    summary = run_case(
        load_case(case, settings or ()), output, until=until, fresh=fresh, allow_scripts=allow_scripts, report=report
    )
    report.close()
    _tell(summary)
    print(f"Everything is in {output}")


@app.command()
def analyse(
    model: Annotated[Path, typer.Argument(help="Model file (JSON).")],
    load: Annotated[str | None, typer.Option(help="Load case.")] = None,
    factor: Annotated[float, typer.Option(help="Load factor.")] = 1.0,
    increments: Annotated[int, typer.Option(help="Equal increments.")] = 1,
    tolerance: Annotated[float, typer.Option(help="Unbalanced over largest force.")] = 1e-8,
    output: Annotated[Path | None, typer.Option(help="Result file; left out: standard output.")] = None,
) -> None:
    """Solve a structural model."""
    from shellform.structure import model as models

    analysis = models.analyse(
        models.read_model(model), load=load, factor=factor, increments=increments, tolerance=tolerance
    )
    text = json.dumps(models.result(analysis), default=_no_number)
    if output is None:
        print(text)
    else:
        from shellform.study.case import write_text

        write_text(output, text)
    if not analysis.converged:
        raise NotConverged(analysis.message)


@app.command()
def render(
    run: Annotated[Path, typer.Argument(help="Run folder.")],
    load: Annotated[str | None, typer.Option(help="none, design or additional.")] = None,
    design: Annotated[str | None, typer.Option(help="unbraced, initial, unloaded or optimised.")] = None,
    limit: Annotated[float | None, typer.Option(help="End of the colour scale, m.")] = None,
) -> None:
    """Draw deviation maps of a run."""
    from shellform.study.run import draw_run

    for file in draw_run(run, load=load, design=design, limit=limit):
        print(file)


@app.command()
def verify() -> None:
    """Run the published cases and gradient checks."""
    from shellform.structure.verification import verify as rows

    failed = 0
    print(f"{'case':42} {'value':>14} {'reference':>14} {'difference':>11}       source")
    for row in rows():
        failed += not row.passed
        mark = "pass" if row.passed else "FAIL"
        print(f"{row.name:42} {row.value:14.7g} {row.reference:14.7g} {row.difference:11.1e} {mark}  {row.source}", flush=True)
    if failed:
        raise NotConverged(f"{failed} cases do not hold")


class _Progress:
    """A spinner with the present step on a terminal; what is finished stays as a line, there and elsewhere."""

    def __init__(self) -> None:
        from rich.console import Console

        self.console = Console(stderr=True, highlight=False, markup=False, soft_wrap=True)
        self.status = self.console.status("starting")
        self.status.start()

    def __call__(self, stage: str, text: str) -> None:
        if text.startswith(("done", "kept", "loading", "no pictures")):
            self.console.print(f"{stage}: {text}")
        self.status.update(f"{stage}: {text}")

    def close(self) -> None:
        """Ends the spinner."""
        self.status.stop()


def _tell(summary: dict[str, Any]) -> None:
    """What a designer asks first."""
    for name, design in summary.get("designs", {}).items():
        row = design["loads"]
        cells = [
            f"{each}: {1e3 * row[each]['deviation_max']:6.1f} mm max, {1e3 * row[each]['deviation_mean']:5.1f} mean"
            + ("" if row[each]["on_branch"] else " (snapped)")
            for each in row
        ]
        print(f"{name:>10}  {design['cables']:4d} cables  " + "   ".join(cells))
    if "optimisation" in summary:
        told = summary["optimisation"]
        print(f"objective {told['objective_start']:.3g} -> {told['objective_end']:.3g}: {told['status']}")


def _no_number(value: object) -> Any:
    raise TypeError(f"can't be written as JSON: {type(value).__name__}")
