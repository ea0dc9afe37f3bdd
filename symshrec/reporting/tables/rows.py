"""§5 Which runs stand in a table: those listed, in their order, then every other finished run that is there."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from symshrec.metrics import METRICS
from symshrec.reporting.tables.published import published_methods
from symshrec.reporting.tables.results import AGAIN, data_key, describe_data, find_score, read_result

METRICS_FILE = "metrics.json"
NO_RUNS = ("tables", "training")  # beside the runs on some data


@dataclass(frozen=True)
class Rows:
    """The runs on some data.

    folder: of these runs. results: what each measured, by its path in there, in the tables' order.
    missing: listed runs that have not run. left_out: one line for each run found that is in no table.
    """

    folder: Path
    results: dict[str, dict]
    missing: list[str]
    left_out: list[str]


def find_rows(
    folder: Path,
    listed: Sequence[str],
    apart: Collection[str] = (),
    manifest: str | None = None,
    optional: Collection[str] = (),
) -> Rows:
    """Read the listed runs in a folder of runs, and all others that have ended there.

    A listed run must be fit for the table; another one is left out with the reason where it is partial, on other
    clouds, not scored at the tables' tolerances or damaged. One whose title is taken, by a listed or a published row,
    has its folder behind the title.

    Args:
        folder: runs/<data>. listed: folders in there. apart: folders in there that belong in no table.
        manifest: hash of the data as it is now; None where that is not known.
        optional: listed ones that are not missed, and left out where they were measured on another version of the data.

    Raises:
        ValueError: naming file and field of a listed result that is damaged, or the listed runs on another version of
            the data.
    """
    found = {name: read_result(path) for name in listed if (path := folder / name / METRICS_FILE).exists()}
    missing = [name for name in listed if name not in found and name not in optional]
    old = {name for name in optional if name in found and manifest not in (None, _manifest(found[name]))}
    left_out = [_old(folder / name, found.pop(name)) for name in listed if name in old]
    left_out += [_partial(folder / name, result) for name, result in found.items() if result.get("partial")]
    results = {name: result for name, result in found.items() if not result.get("partial")}
    _check_manifest(results, manifest)
    others = {}
    for name in _others(folder, {*listed, *apart}):
        try:
            others[name] = read_result(folder / name / METRICS_FILE)
        except ValueError as error:
            left_out.append(str(error))
    reference = next(iter(results.values()), None) or _reference(others.values(), manifest)
    for name, result in others.items():
        if reason := _unfit(folder / name, result, reference):
            left_out.append(reason)
        else:
            results[name] = {**result, "name": _free_name(name, result["name"], results)}
    return Rows(folder, results, missing, left_out)


def _others(folder: Path, known: Collection[str]) -> Iterator[str]:
    """Paths in `folder` of the other runs in it, by name; one with more settings may lie in the folder of another."""
    for path in sorted(folder.rglob(METRICS_FILE)):
        place = path.parent.relative_to(folder)
        inside = any(part.startswith("predictions") for part in place.parts)  # of a store that was kept aside
        if place.parts and place.parts[0] not in NO_RUNS and not inside and place.as_posix() not in known:
            yield place.as_posix()


def _reference(results: Collection[dict], manifest: str | None) -> dict | None:
    """The result over most clouds, on the data as they are now where that is known."""
    fitting = (each for each in results if manifest in (None, _manifest(each)))
    return max(fitting, key=lambda each: each["data"]["clouds"], default=None)


def _unfit(place: Path, result: dict, reference: dict | None) -> str:
    """Why a run that is not listed cannot stand in the table; nothing where it can."""
    if result.get("partial"):
        return _partial(place, result)
    if reference is None or data_key(result) != data_key(reference):
        against = f" than the other rows ({describe_data(reference)})" if reference else " than there is now"
        return f"{place} was measured on other clouds ({describe_data(result)}){against}"
    try:
        for metric in METRICS:
            find_score(result, metric, "all")
    except ValueError as error:
        return str(error)
    return ""


def _old(place: Path, result: dict) -> str:
    return f"{place} was measured on another version of the data ({describe_data(result)})"


def _manifest(result: dict) -> str | None:
    return result["data"].get("manifest_sha256")


def _partial(place: Path, result: dict) -> str:
    return f"{place} ended after {result['data']['clouds']} clouds, before the last; {AGAIN}, without a limit"


def _check_manifest(results: dict[str, dict], manifest: str | None) -> None:
    if manifest is None:
        return
    stale = [name for name, result in results.items() if _manifest(result) != manifest]
    if stale:
        listed = ", ".join(f"{name} ({describe_data(results[name])})" for name in stale)
        raise ValueError(
            f"measured on another version of the data than there is now (manifest {manifest[:12]}): {listed}; evaluate "
            f"{'it' if len(stale) == 1 else 'them'} again"
        )


def _free_name(place: str, name: str, results: dict[str, dict]) -> str:
    taken = {*published_methods(), *(each["name"] for each in results.values())}
    return f"{name} ({place})" if name in taken else name
