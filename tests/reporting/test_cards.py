"""The model cards tell of the weights that are there."""

from pathlib import Path

import pytest

from symshrec.methods.weights import read_weights, shipped, weights_folder
from symshrec.reporting.cards import card_text

RESULTS = Path(__file__).parents[2] / "results"


def test_the_cards_are_those_of_the_weights_and_results():
    page = (weights_folder() / "README.md").read_text(encoding="utf-8")
    assert card_text(page, RESULTS) == page


def test_every_shipped_file_tells_how_it_came_about():
    for name in shipped():
        training = read_weights(name).training
        assert training["clouds"] > 0
        assert training["code"]["modified"] is False
        assert len(training["data"]["manifest_sha256"]) == 64


def test_a_page_without_marks_is_refused():
    with pytest.raises(ValueError, match="lacks the lines"):
        card_text("# Model cards", RESULTS)
