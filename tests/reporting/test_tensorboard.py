import numpy as np
import pytest
import torch
from lightning import Trainer
from lightning.pytorch.loggers import TensorBoardLogger
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from torch.utils.data import DataLoader

from symshrec.benchmark.cloud import Labels
from symshrec.data.batch import Batch
from symshrec.methods.base import SymmetryMethod
from symshrec.planes import Planes
from symshrec.reporting.figures.tensorboard import TensorBoardResults

TRUE = Planes([[1, 0, 0], [0, 1, 0]], np.zeros((2, 3)))


class FirstPlane(SymmetryMethod):
    """Finds the x = 0 plane of every cloud, and doubts a wrong one."""

    def __init__(self, strength: float = 0.5):
        super().__init__()
        self.save_hyperparameters()

    def detect(self, points):
        return Planes([[1, 0, 0], [0, 0, 1]], np.zeros((2, 3)), [0.9, 0.1])


def a_batch(start, clouds=2, points=40):
    generator = torch.Generator().manual_seed(start)
    return Batch(
        points=torch.randn(clouds * points, 3, generator=generator),
        lengths=torch.full((clouds,), points),
        truth=[TRUE] * clouds,
        labels=[Labels("astroid", "cone", f"P{(start + i) % 6}") for i in range(clouds)],
        positions=list(range(start, start + clouds)),
        ids=list(range(start, start + clouds)),
        names=[str(start + i) for i in range(clouds)],
        diagonals=torch.full((clouds,), 2.0, dtype=torch.float64),
    )


@pytest.fixture(scope="module")
def events(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    trainer = Trainer(
        accelerator="cpu",
        logger=TensorBoardLogger(folder, name="", version="tensorboard"),
        callbacks=[TensorBoardResults(clouds=3)],
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
    )
    batches = [a_batch(0), a_batch(2), a_batch(4)]
    trainer.test(FirstPlane(), DataLoader(batches, batch_size=None), verbose=False)
    accumulator = EventAccumulator(str(folder / "tensorboard"), size_guidance={"tensors": 0})
    accumulator.Reload()
    return accumulator


def test_scalars_of_every_metric_and_group(events):
    scores = {tag: events.Scalars(tag)[0].value for tag in events.Tags()["scalars"]}
    assert scores["mAP/all"] == scores["PHC/P3"] == scores["count_accuracy/P0"] + 1 == 1
    assert scores["recall/astroid"] == scores["recall_aware_mAP/cone"] == 0.5


def test_hyperparameters_stand_beside_the_scores(events):
    assert any(tag.startswith("_hparams_/") for tag in events.summary_metadata)
    assert {"mAP", "count_accuracy"} <= set(events.Tags()["scalars"])


def test_curve_and_the_first_clouds_are_drawn(events):
    assert events.Tags()["images"] == [
        "precision_recall",
        *(f"clouds/{position:05d} astroid cone P{position}" for position in range(3)),
    ]
    assert all(len(events.Images(tag)[0].encoded_image_string) > 1000 for tag in events.Tags()["images"])


def test_meshes_hold_points_and_only_counted_planes(events):
    meshes = [tag for tag in events.Tags()["tensors"] if tag.startswith("clouds_3d/")]
    assert len({tag.partition("_VERTEX")[0].partition("_FACE")[0].partition("_COLOR")[0] for tag in meshes}) == 3
    vertices = next(tag for tag in meshes if "00000" in tag and tag.endswith("_VERTEX"))
    shape = [dimension.size for dimension in events.Tensors(vertices)[0].tensor_proto.tensor_shape.dim]
    assert shape == [1, 40 * 4 + 3 * 2 * 4, 3]  # 40 tetrahedra; frames of two true planes and one counted prediction


def test_negative_number_of_clouds_is_refused():
    with pytest.raises(ValueError, match=r"tensorboard\.clouds is -1"):
        TensorBoardResults(clouds=-1)
