"""Views as torch datasets: from an output root or from shards, in an order that can be resumed."""
