"""Judge a manoeuvre for one vehicle, then ask who of a fleet can drive it best."""

from pathlib import Path

import configspace
import omniplan
from omniplan.wording import ranking_lines, report_lines

FOLDER = Path(__file__).parent / "manoeuvres"

spaces = {
    name: configspace.build_space(configspace.load_vehicle(name))
    for name in ("ift-four-steered", "mecanum", "ackermann", "differential")
}

# A vehicle with steered wheels may go sideways, but not without turning them first.
(sideways,) = omniplan.read_trajectories(FOLDER / "parking-sideways.csv")
report = omniplan.validate(sideways, spaces["ift-four-steered"])
print("\n".join(report_lines(report)))

# Its own data sheet answers without knowing the wheels.
sheet = configspace.parse_space(configspace.dump_space(spaces["ift-four-steered"]))
print("v_max at κ_n = 0.5, β = 0:", sheet.v_max(0.5, 0.0).round(3), "m/s")

(ranking,) = omniplan.select(sideways, list(spaces.values()))
print("\n".join(ranking_lines(ranking)))
