"""Communication: neighbours, gossip, missions, hierarchy, and the allocation of places."""
