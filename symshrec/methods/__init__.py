"""The methods of section 3, and ours."""
