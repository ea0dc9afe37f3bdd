"""Planes do not change without a version that says so."""

import json
from dataclasses import replace

import numpy as np
import pytest

from symshrec.planes import Planes
from tests.methods.golden import COMMAND, FILE, Golden, entries, faults, moved

STORED = json.loads(FILE.read_text())
ENTRIES = entries()


@pytest.mark.parametrize("entry", ENTRIES, ids=[each.title for each in ENTRIES])
def test_planes_are_the_golden_ones(entry):
    assert not (complaints := faults(entry, STORED)), "\n".join(complaints)


def test_nothing_is_kept_of_methods_and_weights_that_are_gone():
    assert STORED.keys() == {entry.key for entry in ENTRIES}, f"run `{COMMAND}`"


def test_changed_planes_and_versions_are_noticed():
    golden = Golden("box", lambda points, truth: Planes(np.eye(3), np.zeros((3, 3))), 1e-6, 1, "Box.version")
    rows = [[*normal, 0.0, 1.0] for normal in (-np.eye(3)[::-1]).tolist()]
    shown = next(iter(STORED.values()))["clouds"]
    stored = {"box": {"version": 1, "clouds": dict.fromkeys(shown, rows)}}
    assert faults(golden, stored) == []
    assert "raise Box.version and run" in faults(replace(golden, planes=lambda *_: Planes.empty()), stored)[0]
    assert "Box.version is 2, golden.json has version 1; run" in faults(replace(golden, version=2), stored)[0]
    assert "has no other; run" in faults(replace(golden, title="other"), stored)[0]
    assert moved(rows, [[*row[:3], 0.0, 0.999] for row in rows]) == pytest.approx(1e-3)
