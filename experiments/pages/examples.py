"""What Griffe, which reads the docstrings, does not do by itself: an example keeps its lines, wherever it stands."""

import re

from griffe import Extension

EXAMPLE = re.compile(r"^>>> .+?(?=\n\s*\n|\Z)", re.MULTILINE | re.DOTALL)


class Examples(Extension):
    """Fences what begins with `>>>`, up to an empty line."""

    def on_object(self, *, obj, **_) -> None:
        if obj.docstring is not None:
            obj.docstring.value = EXAMPLE.sub(r"```pycon\n\g<0>\n```", obj.docstring.value)
