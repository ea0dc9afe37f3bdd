"""§2.3 A participant's folder of results, one `points<ID>_res.txt` a cloud."""

import re
from pathlib import Path

from symshrec.benchmark.official.numbers import OfficialFileError, cloud_id
from symshrec.benchmark.official.text import read_results
from symshrec.planes import Planes

RESULTS_NAME = re.compile(r"points([0-9]+)_res\.txt")


class ResultsFolder:
    """The results in a folder by cloud ID, each read when asked for; `ids` ascend.

    Raises:
        OfficialFileError: for a folder that is not there or holds no result, for two files of one ID, and for an
            ID that is too large.
    """

    def __init__(self, root: str | Path):
        self.root = Path(root)
        if not self.root.is_dir():
            raise OfficialFileError(f"{self.root}: there is no such folder of points<ID>_res.txt files")
        self._files: dict[int, Path] = {}
        for path in sorted(self.root.iterdir()):
            name = RESULTS_NAME.fullmatch(path.name)
            other = self._files.setdefault(cloud_id(name[1], path), path) if name else path
            if other != path:
                raise OfficialFileError(f"{path}: {other.name} is of the same cloud; keep one of the two")
        if not self._files:
            raise OfficialFileError(f"{self.root}: there is no points<ID>_res.txt file in it")
        self.ids = sorted(self._files)

    def get(self, cloud: int) -> Planes | None:
        """The planes of a cloud, by its ID, in the file's order; None where it has no file.

        Raises:
            OfficialFileError: naming file and line, where the file is malformed.
        """
        return read_results(self._files[cloud]) if cloud in self._files else None
