"""Who may ask for what: hosts, origins, sessions, rates and sizes."""
