"""Problem files as text that several tests share."""

GOOD = """
[problem]
name = "mine"
[spacecraft]
wet_mass_kg = 2000
dry_mass_kg = 800
thrust_n = 0.3
isp_s = 3000
[mission]
first_departure_mjd = [59215, 60000]
max_duration_days = 700
min_stay_days = 30
[catalogue]
synthetic_bodies = 300
"""

QUICK = (
    GOOD
    + '\n[search]\npruner = "lambert:1.3,mima2:0.97"\nbeam_width = 3\nstarts = 6\n'
    + "start_epochs = 2\nneighbours = 20\ntof_days_step = 40\nsolves_per_rank = 60\n"
)
