"""Selection of stored views: reference photographs, selection runs, their report."""
