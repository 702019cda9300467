"""`gpsearch launch CONFIG`: runs a search, or goes on with one."""

import shlex
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import click
from rich.console import Console

from fitters.models import warm_up
from gpsearch import __version__
from gpsearch.commands.estimate import estimate, not_converged
from gpsearch.commands.progress import ProgressWatcher, duration, work
from gpsearch.commands.signals import Terminated, terminable
from gpsearch.configuration import Configuration, DaskExecutorSection, load_configuration, parse_configuration
from gpsearch.errors import GpsearchError, StoreError
from gpsearch.pictures.front_plot import plot_front
from gpsearch.run import Store, WritableStore, result_of
from gpsearch.run.identity import identify, identify_tests
from gpsearch.run.listing import result_text
from gpsearch.run.lock import RunLock
from gpsearch.run.store import FILE
from gpsearch.search.plan import Plan, plan
from gpsearch.search.search import Search
from workers import WorkersError, open_executor


@click.command()
@click.argument("config", type=click.Path(path_type=Path))
@click.option("--run", "folder", type=click.Path(path_type=Path), help="Run directory, default runs/NAME.")
@click.option(
    "--check", is_flag=True, help="Validate the configuration, print the plan and its cost, run nothing."
)
def launch(config: Path, folder: Path | None, check: bool) -> None:
    """Runs the search of CONFIG, or goes on with it where its run directory is there.

    Leaves front.json and front.png in the run directory. Ctrl-C stops at any time, and so does SIGTERM, which a
    cluster sends ahead of a job's end; the same command goes on. Exit status: 0 done, 1 the run failed, 2 bad
    input, 130 stopped by Ctrl-C, 143 by SIGTERM.
    """
    console = Console(stderr=True, soft_wrap=True, markup=False, emoji=False, highlight=False)
    configuration = load_configuration(config)
    folder = folder or Path("runs") / configuration.name
    planned = plan(configuration)
    if check:
        estimate(configuration, planned)
        return
    with RunLock(folder) as lock, closing(_store(lock, configuration)) as store, terminable():
        if lock.taken_over_from:
            _log(store, "takeover", f"the last launcher died: {lock.taken_over_from}")
        if (begun_by := store.meta("package")) != __version__:
            console.print(f"this run was begun by gpsearch {begun_by}; what {__version__} finds may differ")
        try:
            _search(planned, store, configuration, console)
        except (KeyboardInterrupt, Terminated) as stop:
            _log(store, "stopped", type(stop).__name__)
            console.print(f"stopped after generation {store.totals()[0]}; nothing is lost. To go on:")
            console.print(f"  {shlex.join(['gpsearch', 'launch', str(config), '--run', str(folder)])}")
            sys.exit(143 if isinstance(stop, Terminated) else 130)
        except WorkersError as error:
            _log(store, "failed", str(error))
            raise


def _log(store: WritableStore, kind: str, detail: str) -> None:
    with store.transaction():
        store.log(kind, detail)


def _store(lock: RunLock, configuration: Configuration) -> WritableStore:
    """The run's store, new or as it was left. Raises `GpsearchError` where the configuration is another one."""
    folder = lock.folder
    if not (folder / FILE).exists():
        store = WritableStore.create(lock, configuration.text())
    else:
        store = WritableStore.of(lock)
        before = parse_configuration(
            store.configuration, source=str(store.path), folder=configuration.folder, check_files=False
        )
        conflicts = configuration.conflicts(before)
        if conflicts and not store.totals()[1]:
            # Nothing was found yet: a configuration that failed at its first launch may be mended.
            store.clear()
        elif conflicts:
            store.close()
            changed = "\n".join(f"  {conflict}" for conflict in conflicts)
            raise GpsearchError(
                f"{folder} holds a run with another configuration:\n{changed}\n"
                "Undo these, or name another directory with --run. Only budgets may grow."
            )
    with store.transaction():
        store.set_meta("configuration", configuration.text())
        store.set_meta("folder", str(configuration.folder.resolve()))
    return store


def _identify(store: WritableStore, configuration: Configuration, console: Console) -> None:
    """Has the light table made, once for all workers of this machine, and all materials read before the search."""
    with console.status("integrating the light"):
        table = identify(store, configuration)
    if not table.converged:
        console.print(f"warning: {not_converged(table)}")
    with console.status("reading the test materials"):
        identify_tests(store, configuration)


def _search(planned: Plan, store: WritableStore, configuration: Configuration, console: Console) -> None:
    _identify(store, configuration, console)
    if not _is_remote(configuration):
        with console.status("loading the fit engine (compiled once on a machine, a minute)"):
            warm_up(name for name in planned.baselines if name not in store.baselines())
    with (
        open_executor(configuration.executor.settings(configuration.folder), package="gpsearch") as executor,
        ProgressWatcher(console, planned.budget) as watcher,
    ):
        before = store.totals()[0]
        verb = f"goes on after generation {before}" if before else "starts"
        console.print(f"{configuration.name} {verb} on {executor.description}")
        _log(store, "launch", f"gpsearch {__version__} after generation {before} on {executor.description}")
        reason = Search(planned, store, executor, watcher).run()
        _log(store, "end", reason)
    _report(store, configuration, console, reason)


def _report(store: Store, configuration: Configuration, console: Console, reason: str) -> None:
    """Writes front.json and front.png and lists the front beside the baselines."""
    result = result_of(store, configuration)
    folder = store.path.parent
    _leave(folder / "front.json", lambda path: path.write_text(result.to_text()))
    _leave(folder / "front.png", lambda path: plot_front(result, path))
    run = result.run
    console.print(
        f"done ({reason}): {run.generations} generations, {run.candidates:,} candidates, {duration(run.seconds)}"
    )
    _, candidates, fitted = store.totals()
    given_up = sum(generation.given_up for generation in store.generations())
    console.print(f"fits: {work(candidates, fitted, given_up)}", highlight=False)
    click.echo(result_text(result))
    click.echo(f"front: {folder / 'front.json'}   picture: {folder / 'front.png'}")


def _leave(path: Path, write: Callable[[Path], object]) -> None:
    """Puts what `write` writes in the place of `path`, whole. Raises `StoreError` where the disk refuses."""
    part = path.with_name(f"part-{path.name}")
    try:
        write(part)
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise StoreError(
            f"{path}: cannot be written ({error.strerror}); the run is safe: make room or mend the disk, and the"
            " same command writes it"
        ) from None


def _is_remote(configuration: Configuration) -> bool:
    return isinstance(configuration.executor, DaskExecutorSection) and configuration.executor.scheduler is not None
