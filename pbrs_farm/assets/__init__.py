"""Downloads: example homes and skies, through Debian packages; effects: network, cache."""
