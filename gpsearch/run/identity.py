"""What problem a run is about, by content: materials, the light that reaches them, and the metric.

Errors of two runs can be compared where these are the same, whatever the files are called.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from fitters.materials import Material, load_material
from fitters.scenes import LightTable, light_table
from gpsearch.configuration import Configuration
from gpsearch.errors import GpsearchError
from gpsearch.run.store import Store
from gpsearch.run.writing import WritableStore

MATERIALS, LIGHT = "material_sha256", "light_sha256"
"""Keys under which a store keeps the hashes: of materials by reference, and of the light table."""


@dataclass(frozen=True)
class ProblemIdentity:
    """A problem by content hashes.

    materials: of each material by its reference in the configuration
    light:     of the light table, which light, geometry and their settings make
    """

    materials: Mapping[str, str]
    light: str
    metric: str

    @classmethod
    def of(cls, store: Store, configuration: Configuration) -> "ProblemIdentity | None":
        """The identity that a run has stored; None for runs of versions that stored none."""
        known, light = stored_materials(store), store.meta(LIGHT)
        if light is None or not known.keys() >= set(configuration.materials):
            return None
        return cls({name: known[name] for name in configuration.materials}, light, configuration.metric)

    @property
    def sha256(self) -> str:
        """In hexadecimal; the order and the names of materials do not matter."""
        return sha256(json.dumps([sorted(self.materials.values()), self.light, self.metric]).encode()).hexdigest()

    def differences(self, other: "ProblemIdentity") -> list[str]:
        """In words, what another problem (`other`) has otherwise."""
        changes = [f"metric: {other.metric} instead of {self.metric}"] if self.metric != other.metric else []
        if self.light != other.light:
            changes.append("scene: another light or geometry")
        ours, theirs = set(self.materials.values()), set(other.materials.values())
        more = [_name(reference) for reference, content in other.materials.items() if content not in ours]
        fewer = [_name(reference) for reference, content in self.materials.items() if content not in theirs]
        if more or fewer:
            changes.append(f"materials: {', '.join(more) or 'none'} instead of {', '.join(fewer) or 'none'}")
        return changes


def _name(reference: str) -> str:
    return Path(reference).name


def stored_materials(store: Store) -> dict[str, str]:
    """Content hashes of materials and test materials, by reference."""
    return json.loads(store.meta(MATERIALS) or "{}")


def identify(store: WritableStore, configuration: Configuration) -> LightTable:
    """Stores the content hashes of the light table and the materials; returns the table.

    Raises `GpsearchError` where the run has found something for other content, or under a light table of a version
    that made another one; `FittersError` for a bad file.
    """
    folder, begun = store.path.parent, store.totals()[1] > 0
    table = light_table(configuration.scene.recipe, base=configuration.folder)
    if begun and store.meta(LIGHT) != table.sha256:
        raise GpsearchError(
            f"{folder}: this run was searched under another light table: its light or geometry has "
            "changed, or an earlier gpsearch made it. Errors under two tables cannot be compared: begin again "
            "with another --run"
        )
    known = stored_materials(store)
    hashes = {name: load_material(name, base=configuration.folder).sha256 for name in configuration.materials}
    changed = [name for name, content in hashes.items() if known.get(name, content) != content]
    if begun and changed:
        raise GpsearchError(
            f"{folder}: this run was searched on another content of {', '.join(changed)}. Errors on two materials "
            "cannot be compared: restore the file, or begin again with another --run"
        )
    with store.transaction():
        store.set_meta(LIGHT, table.sha256)
        store.set_meta("light_distance", repr(table.distance))
        store.set_meta(MATERIALS, json.dumps(known | hashes))
    return table


def identify_tests(store: WritableStore, configuration: Configuration) -> None:
    """Stores the content hashes of test materials that nothing was fitted to yet. Raises `FittersError`."""
    fitted = {reference for _, reference in store.transfers()}
    missing = [reference for reference in configuration.test_materials if reference not in fitted]
    hashes = {name: load_material(name, base=configuration.folder).sha256 for name in missing}
    with store.transaction():
        store.set_meta(MATERIALS, json.dumps(stored_materials(store) | hashes))


def require_content(hashes: Mapping[str, str], material: Material, run: str) -> None:
    """Raises `GpsearchError` where a material is not what a run had under its name; `hashes` by name."""
    if hashes.get(material.name, material.sha256) != material.sha256:
        raise GpsearchError(
            f"{run}: {material.name} has another content than when the run was searched; restore its file"
        )
