"""Key figures of a space, as data and as a table."""

import io
import json

import pytest
from rich.console import Console

import configspace
from configspace import Grid, manoeuvrability_index
from omniplan.inspection import inspect_space, inspection_table


@pytest.mark.parametrize(
    ("name", "of"),
    [
        ("ift-four-steered", "of all motions"),
        ("ackermann", "of the motions along its line"),
        ("synchro-drive", "of the motions without turning"),
    ],
)
@pytest.mark.parametrize("by_sheet", [False, True])
def test_the_index_is_shown_and_told(name: str, of: str, by_sheet: bool) -> None:
    vehicle = configspace.load_vehicle(name)
    space = configspace.build_space(vehicle, Grid(80, 144), cache=False)
    if by_sheet:
        space = configspace.parse_space(configspace.dump_space(space))
    facts = inspect_space(space)
    index = manoeuvrability_index(space)
    told = json.loads(json.dumps(facts))["manoeuvrability"]
    assert told["share"] == index.share
    assert told["speed_share"] == index.speed_share
    assert told["dimension"] == (2 if name == "ift-four-steered" else 1)
    console = Console(width=200, file=io.StringIO(), record=True)
    console.print(inspection_table(name, facts))
    text = console.export_text()
    assert f"{index.share:.2%} {of}" in text
    assert f"{index.speed_share:.2%} weighted by speed" in text
