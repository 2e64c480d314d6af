"""UAV drivers, one per file; each is registered under the entry-point group of its package."""
