"""Model cards: the tables of symshrec/weights/README.md from the weights there and results/: `experiments/cards.py`."""

from pathlib import Path

from omegaconf import DictConfig

from symshrec.benchmark.storage import write_atomically
from symshrec.configs import entry
from symshrec.methods.weights import shipped, weights_folder
from symshrec.reporting.cards import card_text


@entry
def cards(config: DictConfig) -> None:
    """Write anew what lies between the page's marks."""
    page = weights_folder() / "README.md"
    write_atomically(page, card_text(page.read_text(encoding="utf-8"), Path(config.paths.results)).encode())
    print(f"written: {page}, on {', '.join(shipped())}")


if __name__ == "__main__":
    cards()
