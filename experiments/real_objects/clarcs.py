"""pyclarcs' symmetry plane of clouds that come in on stdin, as its README runs it; with pyclarcs on the path.

In: the number of points as int64, then so many (x, y, z) as float64. Out: a line of JSON for each cloud.
"""

import json
import struct
import sys
import time

DIAGONAL = 150.0  # its lengths are millimetres of a skull


def main() -> None:
    """Answer until stdin ends."""
    import numpy as np
    from pyclarcs import __version__
    from pyclarcs.coarse import coarse_symmetry
    from pyclarcs.fine import em_icp_sym, em_icp_sym_corres
    from pyclarcs.principal_axes import best_principal_axis_plane

    print(json.dumps({"version": __version__}), flush=True)
    while head := sys.stdin.buffer.read(8):
        (count,) = struct.unpack("<q", head)
        points = np.frombuffer(sys.stdin.buffer.read(24 * count), "<f8").reshape(-1, 3)
        start = time.process_time()
        low, high = points.min(axis=0), points.max(axis=0)
        scale, centre = DIAGONAL / np.linalg.norm(high - low), (low + high) / 2
        scaled = (points - centre) * scale
        plane = coarse_symmetry(scaled, best_principal_axis_plane(scaled), seed=0)
        plane = em_icp_sym_corres(scaled, em_icp_sym(scaled, plane))
        offset = float(plane.d / scale + plane.n @ centre)
        answer = {"normal": plane.n.tolist(), "offset": offset, "seconds": time.process_time() - start}
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
