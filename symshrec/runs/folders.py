"""A run's or training's folder: one process at a time, and the results of one folder of data alone."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lightning.pytorch.utilities import rank_zero_only
from omegaconf import DictConfig

from symshrec.data.settings import DataKind
from symshrec.files.atomic import remove_temporaries, sole_writer, write_atomically

DATA = "data.json"  # root and fingerprint of the data whose results a folder holds


def is_first_process() -> bool:
    """Whether this is the process that writes; of several that train together, the others never do."""
    return rank_zero_only.rank == 0  # type: ignore[attr-defined]  # set, but not declared


@contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """Hold a folder while the first process works in it, and clear away what killed ones left half-written.

    Raises:
        FolderInUseError: where another process works there.
    """
    if not is_first_process():
        yield
        return
    with sole_writer(folder):
        remove_temporaries(folder)
        yield


def refuse_other_data(folder: Path, config: DictConfig, fingerprint: str, going_on: bool = False) -> None:
    """Remember whose results a folder holds, or raise ValueError, naming both, where they are another data's.

    The same clouds elsewhere are welcome. Clouds that changed where they lay make a run start anew, but no training
    may go on with them (`going_on`). Folders of clouds in files are known by times of change, which tell too little
    to say that of.
    """
    now = {"root": _root(config), "fingerprint": fingerprint}
    root, known = _recorded(folder) or now.values()
    changes_matter = going_on and config.data.kind is DataKind.shards
    if known != fingerprint and (root != now["root"] or changes_matter):
        raise ValueError(
            f"{folder} holds results for the data in {root} ({known[:12]}), not for {now['root']} "
            f"({fingerprint[:12]}); give another folder, or remove that one"
        )
    if is_first_process():
        write_atomically(folder / DATA, (json.dumps(now, indent=1) + "\n").encode())


def is_of_this_root(folder: Path, config: DictConfig) -> bool:
    """Whether a folder's results are for the data in `data.root`, as far as it says."""
    recorded = _recorded(folder)
    return recorded is None or recorded[0] == _root(config)


def _root(config: DictConfig) -> str:
    return str(Path(config.data.root).resolve())


def _recorded(folder: Path) -> tuple[str, str] | None:
    """Root and fingerprint of the data that a folder is for; None where it doesn't say, as older ones don't."""
    try:
        there = json.loads((folder / DATA).read_text())
        return there["root"], there["fingerprint"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
