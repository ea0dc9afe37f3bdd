"""§5 `symshrec reproduce data=quick|paper [rows.all=true]`: clouds, rows and tables, of which only what is missing."""

from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig

from symshrec.runs.command import entry


@entry
def command(config: DictConfig) -> None:
    """Make what is missing of the data, run the rows that are missing or out of date, write and print the tables."""
    from symshrec.runs.reproduce import reproduce

    given = HydraConfig.get()
    sources = given.runtime.config_sources
    folders = [Path(each.path) for each in sources if each.provider == "command-line" and each.schema == "file"]
    print(reproduce(config, list(given.overrides.task), folders))
