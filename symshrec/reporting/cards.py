"""Model cards: what shipped weights say of themselves and results say of them, as tables in weights/README.md."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from symshrec.methods.weights import Weights, read_weights, shipped
from symshrec.metrics import METRICS
from symshrec.reporting.tables.results import LABELS, find_score, read_result
from symshrec.reporting.tables.typeset import Grid, Text, markdown

BEGIN, END = "<!-- facts: written by experiments/cards.py -->", "<!-- end of facts -->"
FULL = ("paper", "paper-so3", "hard")  # folders of results/
PRETRAINING = ("m2_third", "m2_third_scratch", "m2_published", "m2_scratch")  # runs of results/paper/, in pairs
TRAINED = ("weights", "run", "network", "clouds seen", "epochs", "minutes", "on", "started from", "sha256")
HEADER = ("run", *(f"{LABELS.get(metric, metric)} ↑" for metric in METRICS))


def card_text(page: str, results: Path) -> str:
    """The page with the tables between its marks written anew.

    Args:
        page: text of weights/README.md.
        results: folder of results/<data>/, whose metrics.json name the weights they were made with.

    Raises:
        ValueError: where the page lacks the marks.
    """
    if BEGIN not in page or END not in page:
        raise ValueError(f"the page lacks the lines {BEGIN!r} and {END!r} between which its tables go")
    before, _, rest = page.partition(BEGIN)
    _, _, after = rest.partition(END)
    everything = [read_weights(name) for name in shipped()]
    grids = [trained_grid(everything), *pretraining_grids(results / "paper"), *tested_grids(everything, results)]
    tables = map(markdown, grids)
    return "\n".join([f"{before}{BEGIN}", "", *tables, f"{END}{after}"])


def trained_grid(everything: Iterable[Weights]) -> Grid:
    """A row for every file: what it was trained on, for how long and where."""
    rows = []
    for weights in everything:
        training = weights.training
        machine = training["hardware"]
        row = (
            weights.name,
            training["name"],
            ", ".join(f"{key} {_plain(value)}" for key, value in weights.network.items()),
            f"{training['clouds']:,}",
            f"{training['epochs']:.1f}",
            f"{training['seconds'] / 60:.0f}",
            machine["gpu"] or f"{machine['cpu']}, CPU",
            Path(start).parent.name if (start := training["settings"].get("train.init")) else "chance",
            weights.sha256[:12],
        )
        rows.append([Text(each) for each in row])
    return Grid("How they were trained", TRAINED, rows, left=3)


def tested_grids(everything: Iterable[Weights], results: Path) -> Iterator[Grid]:
    """The scores of all runs with these very weights on data of full size, one grid for each: `make tables` writes the
    others anew."""
    hashes = {weights.sha256 for weights in everything}
    for folder in (results / name for name in FULL):
        found = [read_result(path) for path in sorted(folder.glob("*/metrics.json"))]
        found = [each for each in found if hashes & {used["sha256"] for used in each.get("weights") or ()}]
        if found:
            yield Grid(f"Tested on {folder.name} at 1° and 1 %", HEADER, [_scores(each) for each in found])


def pretraining_grids(results: Path) -> Iterator[Grid]:
    """M2 from its pre-trained encoder and from chance, for little training and for more, where that was tested."""
    files = [results / name / "metrics.json" for name in PRETRAINING]
    if all(file.exists() for file in files):
        rows = [_scores(read_result(file)) for file in files]
        yield Grid("What pre-training is worth to M2, on paper at 1° and 1 %", HEADER, rows)


def _scores(result: dict) -> list[Text]:
    return [Text(result["name"]), *(Text(f"{find_score(result, metric, 'all'):.4f}") for metric in METRICS)]


def _plain(value: object) -> str:
    return "×".join(map(str, value)) if isinstance(value, list) else str(value)
