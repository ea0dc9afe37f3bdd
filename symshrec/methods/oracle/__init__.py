"""Not in the paper: the true planes as a method, which shows what estimation alone loses."""
