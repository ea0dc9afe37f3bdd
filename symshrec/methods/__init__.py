"""The methods of section 3, and ours."""

DEFAULT = "m4"  # for people's own clouds
