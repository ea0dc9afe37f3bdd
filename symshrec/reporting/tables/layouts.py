"""Which tables there are: the paper's Tables 2–4, the same ten times tighter, under full rotations, P6–P9, P10–P15."""

from dataclasses import dataclass

from symshrec.benchmark.cloud import FAMILIES, HARD_PERTURBATIONS, PUBLISHED_PERTURBATIONS, SCAN_PERTURBATIONS
from symshrec.reporting.tables.results import EPSILON, THETA_DEG, TIGHT_EPSILON, TIGHT_THETA_DEG


@dataclass(frozen=True)
class Layout:
    """The columns of one table (group → printed name), its printed decimals and its tolerances.

    table: the number of one of the paper's tables, which has published figures; the name of one of ours.
    caption: what the table shows.
    """

    table: int | str
    caption: str
    groups: dict[str, str]
    decimals: int
    theta_deg: float = THETA_DEG
    epsilon: float = EPSILON

    @property
    def published(self) -> bool:
        """Whether the paper has this table."""
        return isinstance(self.table, int)


@dataclass(frozen=True)
class Document:
    """One file's name without suffix, its title, and the tables in it."""

    name: str
    title: str
    layouts: tuple[Layout, ...]


ALL = {"all": "all"}
BY_PERTURBATION = {name: name for name in PUBLISHED_PERTURBATIONS}
BY_FAMILY = {name: f"S{i} {name.replace('_', ' ')}" for i, name in enumerate(FAMILIES, 1)}


def _tolerances(theta_deg: float, epsilon: float) -> str:
    return f"θ = {theta_deg:g}°, ε = {100 * epsilon:g}% of the cloud's diagonal"


STANDARD, TIGHT = _tolerances(THETA_DEG, EPSILON), _tolerances(TIGHT_THETA_DEG, TIGHT_EPSILON)


def _paper(layout: Layout) -> Document:
    return Document(f"table{layout.table}", f"SHREC 2023, Table {layout.table}: {layout.caption}", (layout,))


def _ours(table: str, *tolerances: float) -> tuple[Layout, Layout]:
    """The columns of Tables 2–4 for a table that the paper has not."""
    return (
        Layout(table, "by perturbation", ALL | BY_PERTURBATION, 3, *tolerances),
        Layout(table, "by family of shapes", BY_FAMILY, 3, *tolerances),
    )


PAPER_DOCUMENTS = (
    _paper(Layout(2, f"overall performance at {STANDARD}", ALL, 4)),
    _paper(Layout(3, f"performance per perturbation at {STANDARD}", BY_PERTURBATION, 3)),
    _paper(Layout(4, f"performance per family of shapes at {STANDARD}", BY_FAMILY, 4)),
)
TIGHT_DOCUMENT = Document("table_tight", f"Ten times tighter: {TIGHT}", _ours("tight", TIGHT_THETA_DEG, TIGHT_EPSILON))
SO3_DOCUMENT = Document("table_so3", f"Every cloud under a uniform rotation: {STANDARD}", _ours("so3"))
HARD_DOCUMENT = Document(
    "table_hard",
    "Beyond the paper: P6 partial clouds, P7 strong noise, P8 outliers, P9 few points, at " + STANDARD,
    (Layout("hard", "by perturbation", ALL | {name: name for name in HARD_PERTURBATIONS}, 3),),
)
SCAN_DOCUMENT = Document(
    "table_scan",
    "Beyond the paper, as scanners see: P10 uneven density, P11 one-sided scanner, P12 single view, P13 cut or bite, "
    "P14 floor, P15 nearly symmetric, at " + STANDARD,
    (Layout("scan", "by perturbation", ALL | {name: name for name in SCAN_PERTURBATIONS}, 3),),
)
