"""Where a result comes from: code, machine and memory, for its metrics.json."""

import os
import platform
import resource
import subprocess
import sys
from pathlib import Path

import torch

import symshrec


def code_version() -> dict[str, str | bool | None]:
    """The package's version and, in a checkout, its commit and whether tracked files were changed since."""
    folder = Path(symshrec.__file__).parent

    def git(*words: str) -> str | None:
        try:
            command = ["git", "-C", str(folder), *words]
            done = subprocess.run(command, capture_output=True, text=True, timeout=10, check=False)
        except (OSError, subprocess.TimeoutExpired):
            return None
        return done.stdout.strip() if done.returncode == 0 else None

    changes = git("status", "--porcelain", "--untracked-files=no", "--", str(folder))
    return {
        "version": symshrec.__version__,
        "commit": git("rev-parse", "HEAD"),
        "modified": None if changes is None else bool(changes),
    }


def hardware() -> dict[str, str | int | float | None]:
    """The machine: processor, cores, memory in GiB, accelerator, and the versions that set its speed."""
    return {
        "cpu": _processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "memory_gib": round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1),
        "gpu": torch.cuda.get_device_name() if torch.cuda.is_available() else None,
        "python": platform.python_version(),
        "torch": torch.__version__,
    }


def _processor() -> str:
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def peak_memory_mib() -> float:
    """The largest resident size of this process and of any ended child of it, in MiB."""
    unit = 1 if sys.platform == "darwin" else 1024
    peaks = [resource.getrusage(who).ru_maxrss * unit for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return round(max(peaks) / 2**20, 1)
