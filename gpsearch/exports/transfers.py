"""`test` of an entry of front.json: what a model is worth on the test materials."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from fitters.fitting import RESIDUALS
from fitters.grid import CHANNELS
from gpsearch.exports.numbers import finite, finite_or_none
from gpsearch.run import Transfer, combined


def transfer_entry(
    transfers: Mapping[str, Transfer | None], metric: str, symbols: Sequence[str] | None
) -> dict[str, Any]:
    """`{"test": ..}` of transfers by material's name, None where there is none yet; nothing without materials.

    `symbols` are the parameters of a formula, None for what is none. Where a model could not be fitted to a
    material its errors there are null, and its error over all of them is; its parameters leave the material out.
    """
    if not transfers:
        return {}
    known = [one for one in transfers.values() if one is not None]
    metrics = combined(known) if len(known) == len(transfers) else dict.fromkeys(RESIDUALS, math.inf)
    entry: dict[str, Any] = {
        "error": finite_or_none(metrics[metric]),
        "errors": {name: _errors(one) for name, one in transfers.items()},
        "metrics": finite(metrics),
        "warnings": [warning for one in known for warning in one.warnings],
    }
    if symbols is not None:
        fitted = {
            n: one for n, one in transfers.items() if one is not None and all(map(math.isfinite, one.errors))
        }
        entry["parameters"] = {
            symbol: {name: list(one.parameters[symbol]) for name, one in fitted.items()} for symbol in symbols
        }
    return {"test": entry}


def _errors(transfer: Transfer | None) -> list[float | None]:
    return [finite_or_none(error) for error in transfer.errors] if transfer else [None] * len(CHANNELS)
