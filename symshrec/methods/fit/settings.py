"""Checks of the settings of M4 and of the refinement."""


def check_ranges(settings, ranges: dict[str, tuple[float, float]]) -> None:
    """Hold settings to their least and greatest values.

    Raises:
        ValueError: naming the first that is outside.
    """
    for name, (low, high) in ranges.items():
        value = getattr(settings, name)
        if not low <= value <= high:
            raise ValueError(f"{name} is {value}, expected a number in [{low:g}, {high:g}]")
