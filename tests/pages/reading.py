"""README and docs/ as what is in them: blocks of code, what is named within a line, links and anchors."""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
README = ROOT / "README.md"
DOCS = sorted(ROOT.glob("docs/**/*.md"))
OTHERS = (
    "CONTRIBUTING.md",
    "experiments/README.md",
    "symshrec/benchmark/README.md",
    "symshrec/methods/weights/README.md",
)
PAGES = [README, *DOCS, *(ROOT / name for name in OTHERS)]
BLOCK = re.compile(
    r"(?:^<!-- run(?P<run>: (?P<file>\S+))? -->\n)?^```(?P<language>\w*)\n(?P<text>.*?)^```$", re.M | re.S
)
SPAN, LINK, HEADING = re.compile(r"`([^`\n]+)`"), re.compile(r"\]\(([^)\s]+)\)"), re.compile(r"^#+ (.+)$", re.M)


@dataclass(frozen=True)
class Block:
    """Code of a language; `runs` where `<!-- run -->` stands above it; `file` that it is to be saved in, if named."""

    language: str
    text: str
    runs: bool
    file: str | None

    @property
    def lines(self) -> list[str]:
        """Of shell: the commands."""
        lines = (re.sub(r"(^|\s+)#.*", "", line).strip() for line in self.text.splitlines())
        return [line for line in lines if line]


def blocks(page: Path) -> list[Block]:
    """The blocks of a page, in order."""
    found = BLOCK.finditer(page.read_text(encoding="utf-8"))
    return [Block(each["language"], each["text"], each[0].startswith("<!-- run"), each["file"]) for each in found]


def spans(page: Path) -> list[str]:
    """What stands as code within the page's lines."""
    return SPAN.findall(_prose(page))


def links(page: Path) -> list[str]:
    """Targets of links and pictures."""
    return LINK.findall(SPAN.sub("", _prose(page)))


def anchors(page: Path) -> set[str]:
    """What may stand behind # in a link to the page; of the Python reference, the objects too."""
    words = (re.sub(r"[^\w\- ]", "", heading.lower()).strip() for heading in HEADING.findall(_prose(page)))
    return {each.replace(" ", "-") for each in words}


def _prose(page: Path) -> str:
    return BLOCK.sub("", page.read_text(encoding="utf-8"))
