"""The command seqsearch: one file a sub-command."""
