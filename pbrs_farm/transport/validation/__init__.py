"""Is the light right? Rooms with known answers, statistics, and the claims of `verify --light`."""
