"""§2.1 `symshrec generate data=smoke|quick|paper|x10 [pose=so3]`: the benchmark as shards."""

from omegaconf import DictConfig

from symshrec.benchmark.generate import generate_dataset
from symshrec.runs.command import entry
from symshrec.runs.config import benchmark_of


@entry
def command(config: DictConfig) -> None:
    """Make what is missing under data.root and verify what is there."""
    manifest = generate_dataset(benchmark_of(config), config.data.root, workers=config.workers)
    clouds = ", ".join(f"{each.clouds} {split}" for split, each in manifest.splits.items())
    size = sum(each.bytes for each in manifest.shards) / 1e9
    print(f"{config.data.root}: {clouds} clouds, {size:.2f} GB, manifest {manifest.hash[:12]}")
