"""§3.1 Five-fold cross-validation: what the trainings of one run on different folds have in common."""

import json
from pathlib import Path

import numpy as np
from omegaconf import DictConfig

from symshrec.runs.train import RECORD


def fold_spread(config: DictConfig) -> tuple[list[int], dict[str, tuple[float, float]]]:
    """Mean and standard deviation over the folds that are trained, of every validation figure.

    Only trainings count whose settings are those of `config` but for the fold.

    Returns:
        The folds, and (mean, deviation) by figure; nothing where fewer than two are trained.
    """
    records = {}
    for fold in range(config.data.folds):
        other = config.copy()
        other.data.fold = fold
        path = Path(other.train.folder) / RECORD
        if path.is_file():
            records[fold] = json.loads(path.read_text())
    own = records.get(config.data.fold)
    if own is None:
        return [], {}
    same = {fold: each for fold, each in records.items() if _but_fold(each) == _but_fold(own)}
    if len({each["fold"] for each in same.values()}) < 2:
        return [], {}
    figures = {name: [each["validation"][name] for each in same.values()] for name in own["validation"]}
    return list(same), {name: (float(np.mean(each)), float(np.std(each, ddof=1))) for name, each in figures.items()}


def _but_fold(record: dict) -> dict:
    return {key: value for key, value in record["settings"].items() if key != "data.fold"}
