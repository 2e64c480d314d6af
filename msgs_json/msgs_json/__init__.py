"""The contract between Shearwater's nodes: messages, topics, agents, drivers and the node host."""
