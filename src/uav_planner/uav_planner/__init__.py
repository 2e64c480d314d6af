"""Route and path planning for the UAV: map, worst-case sorties, planners, the UAV agent and its node."""
