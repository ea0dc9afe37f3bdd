"""§5 Every table from finished runs, ours beside the published: `python experiments/tables.py data=quick|paper`."""

from omegaconf import DictConfig

from symshrec.runs.config import entry
from symshrec.runs.tabulate import tabulate


@entry
def tables(config: DictConfig) -> None:
    """Write runs/<data>/tables/; print the tables, what was written, and which runs are in none."""
    done = tabulate(config)
    print(done.text)
    print("\n".join([*(f"written: {path}" for path in done.files), *done.remarks]))


if __name__ == "__main__":
    tables()
