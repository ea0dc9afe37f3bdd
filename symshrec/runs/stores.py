"""Where the predictions of a run lie: one store in use, and beside it those of other settings, kept aside."""

import json
import logging
import os
from collections.abc import Sequence
from pathlib import Path

from symshrec.files.atomic import write_atomically
from symshrec.files.predictions import (
    PART,
    WHOLE,
    DamagedPredictionsError,
    PredictionFileError,
    PredictionStore,
    load_metadata,
    load_predictions,
)
from symshrec.runs.identity import differences, digest

log = logging.getLogger(__name__)
PREDICTIONS = "predictions"  # in a run's folder
IDENTITY = "identity.json"  # beside the predictions: whose they are
RESULTS = ("metrics.json", "config.yaml")  # of a run, which go where its predictions go
UNKNOWN = "unknown"  # instead of the key of what is no predictions file of ours


def open_store(folder: Path, identity: dict) -> PredictionStore:
    """The store of these very predictions in a run's folder, begun or taken up again.

    What lies there from other settings moves to predictions.<digest>, with its times and results; where the asked ones
    were moved away before, they come back. Nothing is removed, and every move is logged.

    Args:
        folder: of the run. identity: see `symshrec.runs.identity.run_identity`.

    Raises:
        OSError: where a folder cannot be made or moved.
    """
    key, place = digest(identity), folder / PREDICTIONS
    there = stored_keys(place) or {digest(each) for each in _recorded(place)}
    if there - {key}:
        aside = _set_aside(place, min(there - {key}))
        log.warning("%s: %s; its predictions are kept in %s", folder, "; ".join(_changes(aside, identity)), aside)
    if there != {key} and (kept := find_store(folder, key)):
        if place.exists():  # and holds no predictions
            _set_aside(place, "empty")
        kept.rename(place)
        _move(RESULTS, place, folder)
        log.warning("%s: predictions of these settings were kept in %s and are taken back", folder, kept.name)
    store = PredictionStore(place, key)
    write_atomically(place / IDENTITY, (json.dumps(identity, indent=1) + "\n").encode())
    return store


def find_store(folder: Path, key: str) -> Path | None:
    """The folder with predictions of this key in a run's folder, in use or kept aside; None where there is none."""
    places = (folder / PREDICTIONS, *sorted(folder.glob(f"{PREDICTIONS}.{_short(key)}*")))
    return next((place for place in places if stored_keys(place) == {key}), None)


def stored_keys(place: Path) -> set[str]:
    """The keys of all predictions files in a folder that are whole; UNKNOWN for a file in another format."""
    keys = set()
    for path in (place / WHOLE, *sorted(place.glob(PART))):
        try:
            keys.add(load_metadata(path).get("key", UNKNOWN))
        except DamagedPredictionsError:
            continue
        except PredictionFileError:
            keys |= {UNKNOWN} if path.exists() else set()
    return keys


def lacking(folder: Path, key: str | None, clouds: int) -> str:
    """What is wrong with the predictions of a finished run; nothing where they are whole and its own.

    Args:
        folder: of the run. key: of its predictions. clouds: how many it is over.
    """
    path = folder / PREDICTIONS / WHOLE
    try:
        found, metadata = len(load_predictions(path).positions), load_metadata(path)
    except PredictionFileError as error:
        return str(error) if path.exists() else f"{path} is gone"
    if metadata.get("key") != key:
        return f"{path} was predicted with other settings than {folder / 'metrics.json'} tells of"
    return "" if found == clouds else f"{path} holds {found} clouds of {clouds}"


def _set_aside(place: Path, key: str) -> Path:
    """Move a folder of predictions, and the results of its run, to a name of their own."""
    _move(RESULTS, place.parent, place)
    plain = aside = place.with_name(f"{place.name}.{_short(key)}")
    number = 1
    while aside.exists():
        number += 1
        aside = plain.with_name(f"{plain.name}.{number}")
    return place.rename(aside)


def _move(names: Sequence[str], source: Path, target: Path) -> None:
    for name in names:
        if (source / name).exists():
            os.replace(source / name, target / name)


def _changes(place: Path, identity: dict) -> list[str]:
    """In which settings the predictions in a folder differ from those asked for."""
    phrases = [each for stored in _recorded(place) for each in differences(stored, identity)]
    changes = [f"stored run differs in {each}" for each in phrases]
    return changes or ["stored run does not record its settings and is not this one"]


def _recorded(place: Path) -> list[dict]:
    """The identity recorded beside predictions; none where there is none that can be read."""
    try:
        stored = json.loads((place / IDENTITY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    return [stored] if isinstance(stored, dict) else []


def _short(key: str) -> str:
    return key[:12]
