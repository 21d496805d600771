"""The parts of `check_problem`: one file for each group of a problem's members."""
