"""AUVs and their world: the AUV agent and drivers, survey field, radio and simulation kernel."""
