"""The demo: a synthetic main belt; needs no file."""
