"""Communication: neighbours, gossip, missions and the hierarchy."""
