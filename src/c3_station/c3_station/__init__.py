"""The base station: scenarios, mission and data custody, bags, summary, report, orchestration."""
