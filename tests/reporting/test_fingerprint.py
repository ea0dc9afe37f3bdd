"""The distance to M3's published profile."""

import math

import pytest

from symshrec.reporting.tables.fingerprint import distance, fingerprint_grid, profile
from symshrec.reporting.tables.published import published_cells
from symshrec.reporting.tables.typeset import markdown


def result_off_by(difference: float, groups: tuple[str, ...] = ()) -> dict:
    """A result that is the published profile of M3 (R1), moved by `difference` in `groups` (everywhere where empty)."""
    cells = {**profile("M3 (R1)"), ("mAP", "all"): published_cells()[2, "M3 (R1)", "mAP", "all"]}
    scores = [
        {
            "metric": metric,
            "group": group,
            "theta_deg": 1.0,
            "epsilon": 0.01,
            "value": value + difference * (not groups or group in groups),
        }
        for (metric, group), value in cells.items()
    ]
    return {"name": "M3 (R1)", "scores": scores}


def test_distance_is_the_root_mean_square_over_the_26_cells_of_tables_3_and_4():
    assert len(profile("M3 (R1)")) == 2 * (6 + 7)
    assert distance(result_off_by(0.0)) == 0
    assert distance(result_off_by(0.05)) == pytest.approx(0.05)
    assert distance(result_off_by(0.1, ("P0",))) == pytest.approx(math.sqrt(2 * 0.1**2 / 26))


def test_a_group_without_a_cloud_is_named():
    result = result_off_by(0.0)
    for score in result["scores"]:
        if score["group"] == "P5":
            score["value"] = None
    with pytest.raises(ValueError, match="no cloud of group P5"):
        distance(result)


def test_the_nearest_alternative_comes_first():
    finished = {"far": ("all off", result_off_by(0.05)), "near": ("one off", result_off_by(0.05, ("egg_keplero",)))}
    printed = markdown(fingerprint_grid(finished))
    assert printed.index("published") < printed.index("near") < printed.index("far")
