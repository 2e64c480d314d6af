"""Route and path planning for the UAV: map, worst-case sorties, planners, agent and node."""
