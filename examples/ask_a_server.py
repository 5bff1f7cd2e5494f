"""Start a server for a small fleet and ask it over zenoh, on loopback, no router."""

import configspace
import omniplan
from services import Client, Server

fleet = [
    configspace.build_space(configspace.load_vehicle(name))
    for name in ("mecanum", "differential")
]
spin = omniplan.Trajectory.from_twists(
    [0.0, 1.0, 3.0, 4.0],
    [[0.0, 0.0, 0.0], [0.0, 0.0, 0.8], [0.0, 0.0, 0.8], [0.0, 0.0, 0.0]],
    name="spin",
)
# Port 0 takes a free one; `omniplan serve` and its clients use 7447.
with (
    Server(fleet, listen="tcp/127.0.0.1:0") as server,
    Client(server.endpoint) as client,
):
    (ranking,) = client.select([spin])
    for candidate in ranking.suitable:
        print(f"{candidate.vehicle}: at best {candidate.score:.2f} s")
