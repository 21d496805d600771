"""The command feasibility: one file a sub-command."""
