"""§2.1 `symshrec generate data=smoke|quick|paper|x10 [pose=so3] [part=K/N]`: the benchmark as shards."""

from omegaconf import DictConfig

from symshrec.benchmark.generate import generate_dataset, generate_part
from symshrec.benchmark.tasks import parse_part
from symshrec.runs.command import entry
from symshrec.runs.config import benchmark_of


@entry
def command(config: DictConfig) -> None:
    """Make what is missing under data.root, or one part of it, and verify what is there."""
    root, part = config.data.root, parse_part(config.part)
    if part is None:
        manifest = generate_dataset(benchmark_of(config), root, workers=config.workers)
        clouds = ", ".join(f"{each.clouds} {split}" for split, each in manifest.splits.items())
        size = sum(each.bytes for each in manifest.shards) / 1e9
        print(f"{root}: {clouds} clouds, {size:.2f} GB, manifest {manifest.hash[:12]}")
        return
    records = generate_part(benchmark_of(config), root, part, workers=config.workers)
    made = f"{len(records)} shards, {sum(each.clouds for each in records)} clouds"
    print(
        f"{root}, part {part.number} of {part.parts}: {made}; when all parts have ended, the same command without part "
        "verifies them and writes the manifest"
    )
