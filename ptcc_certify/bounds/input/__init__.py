"""How large the input gets: from one initial state or a set, whether it stays finite, under limits and disturbances."""
