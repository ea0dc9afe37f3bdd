"""§5 `symshrec tables data=quick|paper`: every table from finished runs, ours beside the published."""

from omegaconf import DictConfig

from symshrec.runs.command import entry


@entry
def command(config: DictConfig) -> None:
    """Write runs/<data>/tables/; print the tables, what was written, and which runs are in none."""
    from symshrec.runs.tabulate import tabulate

    done = tabulate(config)
    print(done.text)
    print("\n".join([*(f"written: {path}" for path in done.files), *done.remarks]))
