"""What is fetched to work with: example homes and skies, through Debian packages; effects: network, cache."""
