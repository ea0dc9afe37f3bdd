"""Model cards: the tables of symshrec/methods/weights/README.md from weights and results: `experiments/cards.py`."""

from pathlib import Path

from omegaconf import DictConfig

from symshrec.files.atomic import write_atomically
from symshrec.methods.weights import shipped, weights_folder
from symshrec.reporting.cards import card_text
from symshrec.runs.command import entry


@entry
def cards(config: DictConfig) -> None:
    """Write anew what lies between the page's marks."""
    page = weights_folder() / "README.md"
    write_atomically(page, card_text(page.read_text(encoding="utf-8"), Path(config.paths.results)).encode())
    print(f"written: {page}, on {', '.join(shipped())}")


if __name__ == "__main__":
    cards()
