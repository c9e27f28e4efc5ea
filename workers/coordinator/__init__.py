"""The one leader: admits houses, sends messages, ends the leases of the dead."""
