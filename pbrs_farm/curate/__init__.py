"""Which stored views to keep: reference photographs, selection runs, their report."""
