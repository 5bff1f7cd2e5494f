import json
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml  # noqa: TID251 - the tests write YAML

import configspace
from configspace.vehicle import Vehicle

STEERED = {"id": "a", "type": "steered", "x": 0.4, "y": 0.2, "max_speed": 1.0}
OTHER = {**STEERED, "id": "b", "x": -0.4}
FIXED = {"id": "f", "type": "fixed", "x": 0.0, "y": -0.4, "max_speed": 1.0}
CASTOR = {"id": "c", "type": "castor", "x": 0.0, "y": -0.4}


def data(**changes: object) -> dict[str, object]:
    return {"name": "agv", "wheels": [STEERED, OTHER], **changes}


def wheel(**changes: object) -> dict[str, object]:
    return data(wheels=[{**STEERED, **changes}, OTHER])


def loaded(
    center_of_gravity: tuple[float, ...] | list[float] = (0.0, 0.0, 1.0),
    **changes: object,
) -> dict[str, object]:
    load = {"center_of_gravity": list(center_of_gravity), **changes}
    return data(wheels=[STEERED, OTHER, CASTOR], load=load)


def problems(given: object) -> dict[str, str]:
    """Problems of a description, by path."""
    with pytest.raises(configspace.InvalidVehicle) as caught:
        configspace.vehicle_from_data(given)
    for problem in caught.value.problems:
        assert str(problem) in str(caught.value)
    return {p.where: f"{p.given}; {p.allowed}" for p in caught.value.problems}


@pytest.mark.parametrize("name", configspace.catalog())
def test_catalogue_vehicles_load(name: str) -> None:
    vehicle = configspace.load_vehicle(name)
    assert vehicle.name == name
    assert vehicle.source
    assert vehicle.boundary_curvature > 0


def test_catalogue_is_sorted() -> None:
    names = configspace.catalog()
    assert list(names) == sorted(names)
    assert len(names) >= 4


@pytest.mark.parametrize("write", [json.dumps, yaml.safe_dump])
def test_yaml_and_json_give_the_same_vehicle(
    write: Callable[[object], str], tmp_path: Path
) -> None:
    path = tmp_path / "agv.txt"
    path.write_text(write(data()))
    assert configspace.load_vehicle(path) == configspace.vehicle_from_data(data())
    assert configspace.load_vehicle(str(path)).name == "agv"


@pytest.mark.parametrize("number", ["1e-1", "1E-1", "1.0e-1", "10e-2", "0.1", "+.1"])
def test_numbers_are_read_as_json_and_yaml_write_them(number: str) -> None:
    text = f'{{"name": "v", "wheels": [{{"id": "a", "type": "steered", "x": {number},'
    vehicle = configspace.parse_vehicle(text + ' "y": 0, "max_speed": 1}]}')
    assert vehicle.wheels[0].x == 0.1


def test_a_dumped_vehicle_is_read_back() -> None:
    tiny = configspace.vehicle_from_data(wheel(y=6.1e-17))
    again = configspace.parse_vehicle(tiny.model_dump_json())
    assert again == tiny


def test_input_is_not_changed() -> None:
    given = data(limits={"max_speed": 1})
    before = json.dumps(given)
    configspace.vehicle_from_data(given)
    assert json.dumps(given) == before


def test_vehicles_are_frozen() -> None:
    vehicle = configspace.vehicle_from_data(data())
    with pytest.raises(ValueError, match="frozen"):
        vehicle.name = "other"  # type: ignore[misc]


# --- the error table of DESIGN.md


def test_unknown_keys_are_errors_with_a_hint() -> None:
    found = problems(
        data(
            wheels=[{**STEERED, "max_sped": 1}, OTHER],
            limits={"max_yawrate_deg": 1},
            wheel=3,
        )
    )
    assert "did you mean max_speed?" in found["wheels[0].max_sped"]
    assert "did you mean max_yaw_rate_deg?" in found["limits.max_yawrate_deg"]
    assert "did you mean wheels?" in found["wheel"]


@pytest.mark.parametrize("key", ["steered", "fixed", "castor", "omni", "mecanum"])
def test_unknown_keys_keep_their_path_whatever_their_name(key: str) -> None:
    assert key in problems(data(**{key: 1}))
    assert f"wheels[0].{key}" in problems(wheel(**{key: 1}))


@pytest.mark.parametrize(
    ("given", "path"),
    [
        (wheel(x=400), "wheels[0].x"),  # millimetres
        (wheel(steering_range=[-90, 90]), "wheels[0].steering_range"),  # no _deg
        (data(limits={"max_yaw_rate": 1.5}), "limits.max_yaw_rate"),
        (wheel(max_speed="1.0 m/s"), "wheels[0].max_speed"),
        (wheel(max_speed="1.0"), "wheels[0].max_speed"),
        (wheel(max_speed=True), "wheels[0].max_speed"),
        (wheel(max_speed=[1.0]), "wheels[0].max_speed"),
        (wheel(x=None), "wheels[0].x"),
        (wheel(x=float("nan")), "wheels[0].x"),
        (wheel(x=float("inf")), "wheels[0].x"),
        (wheel(max_speed=float("inf")), "wheels[0].max_speed"),
        (wheel(max_speed=-1.0), "wheels[0].max_speed"),
        (wheel(max_speed=0), "wheels[0].max_speed"),
        (wheel(max_acceleration=-1.0), "wheels[0].max_acceleration"),
        (wheel(max_steering_rate_deg=-5), "wheels[0].max_steering_rate_deg"),
        (wheel(offset=20), "wheels[0].offset"),  # millimetres
        (wheel(offset=-1.01), "wheels[0].offset"),
        (wheel(offset=float("nan")), "wheels[0].offset"),
        (wheel(offset=None), "wheels[0].offset"),
        (wheel(steering_coupling=-0.1), "wheels[0].steering_coupling"),
        (wheel(steering_coupling=1.5), "wheels[0].steering_coupling"),
        (wheel(type="turntable"), "wheels[0].track"),
        (wheel(type="turntable", track=0), "wheels[0].track"),
        (wheel(type="turntable", track=0.4, offset=0.1), "wheels[0].offset"),
        (wheel(track=0.4), "wheels[0].track"),
        (wheel(steering_range_deg=[-90]), "wheels[0].steering_range_deg"),
        (wheel(steering_range_deg=[-90, 0, 90]), "wheels[0].steering_range_deg"),
        (wheel(steering_range_deg=[90, -90]), "wheels[0].steering_range_deg"),
        (wheel(steering_range_deg=[90, 90]), "wheels[0].steering_range_deg"),
        (wheel(type="turntabel"), "wheels[0]"),
        (wheel(id=""), "wheels[0].id"),
        (wheel(id=7), "wheels[0].id"),
        (data(limits={"max_speed": -1}), "limits.max_speed"),
        (data(limits={"max_speed": float("nan")}), "limits.max_speed"),
        (data(limits={"max_lateral_acceleration": 0}), "limits.max_lateral_accelera"),
        (data(limits=[]), "limits"),
        (
            data(limits={"lateral_acceleration_at": "center_of_gravity"}),
            "limits.lateral_acceleration_at",  # but no load
        ),
        (data(limits={"lateral_acceleration_at": "cog"}), "limits.lateral_acc"),
        (data(load={"center_of_gravity": [0, 0]}), "load.center_of_gravity[2]"),
        (data(load={"center_of_gravity": [0, 0, 0]}), "load.center_of_gravity[2]"),
        (data(load={"mass": 3}), "load.center_of_gravity"),
        (loaded(mass=0), "load.mass"),
        (loaded(tipping_factor=0.9), "load.tipping_factor"),
        (loaded(factor=2), "load.factor"),
        (data(load={"center_of_gravity": [0, 0.2, 1]}), "load"),  # on one line
        (loaded([0, 0.3, 1]), "load"),  # beside the wheels
        (loaded([0.4, 0.2, 1]), "load"),  # on a wheel
        (data(guaranteed={"kappa_rate": -1}), "guaranteed.kappa_rate"),
        (data(guaranteed={"beta_rate": 1}), "guaranteed.beta_rate"),
        (data(skid_steer={}), "skid_steer.effective_track"),
        (data(skid_steer={"effective_track": 0}), "skid_steer.effective_track"),
        (data(skid_steer={"effective_track": 1}), "wheels"),  # steered wheels
        (data(synchro="yes"), "synchro"),
        (data(synchro=True, wheels=[STEERED, FIXED]), "wheels"),
        (data(kappa_g=0), "kappa_g"),
        (data(kappa_g=float("inf")), "kappa_g"),
        (data(reference_point=[0]), "reference_point"),
        (data(reference_point=[0, float("nan")]), "reference_point[1]"),
        (data(footprint=[[0, 0], [1, 1]]), "footprint"),
        (data(footprint=[[0, 0], [1], [0, 1]]), "footprint[1]"),
        (data(name="Has Blanks"), "name"),
        (data(name="../escape"), "name"),
        (data(wheels=[]), "wheels"),
        (data(wheels={}), "wheels"),
        (data(wheels=None), "wheels"),
        (data(wheels=["steered"]), "wheels[0]"),
        ({"wheels": [STEERED]}, "name"),
        ({"name": "agv"}, "wheels"),
        ([], "the text"),
        (None, "the text"),
        ("agv", "the text"),
    ],
)
def test_mistakes_are_reported_with_their_path(given: object, path: str) -> None:
    found = problems(given)
    assert any(where.startswith(path) for where in found), found


def test_castors_carry_the_load() -> None:
    assert configspace.vehicle_from_data(loaded()).load is not None


def test_problems_of_the_load_say_what_is_wrong() -> None:
    assert "one line" in problems(data(load={"center_of_gravity": [0, 0, 1]}))["load"]
    assert "not inside" in problems(loaded([0, 0.3, 1]))["load"]


@pytest.mark.parametrize(
    ("key", "wrong", "meant"),
    [
        ("load", "center_of_gravit", "center_of_gravity"),
        ("load", "tiping_factor", "tipping_factor"),
        ("guaranteed", "kapa_rate", "kappa_rate"),
        ("guaranteed", "beta_rate", "beta_rate_deg"),
        ("skid_steer", "efective_track", "effective_track"),
    ],
)
def test_unknown_keys_of_parts_are_errors_with_a_hint(
    key: str, wrong: str, meant: str
) -> None:
    assert (
        f"did you mean {meant}?"
        in problems(data(**{key: {wrong: 1}}))[f"{key}.{wrong}"]
    )


def test_huge_whole_numbers_are_errors() -> None:
    assert "wheels[0].x" in problems(wheel(x=10**400))


def test_all_mistakes_are_reported_at_once() -> None:
    found = problems(
        {
            "name": "No",
            "wheels": [
                {**STEERED, "x": float("nan"), "max_speed": -1},
                {**OTHER, "colour": "red"},
                {"id": "c", "type": "fixed", "y": "0"},
            ],
            "limits": {"max_speed": float("inf")},
            "mass": 60,
        }
    )
    assert set(found) == {
        "name",
        "wheels[0].x",
        "wheels[0].max_speed",
        "wheels[1].colour",
        "wheels[2].x",
        "wheels[2].y",
        "limits.max_speed",
        "mass",
    }


def test_one_mistake_in_the_only_wheel_is_one_problem() -> None:
    assert set(problems(data(wheels=[{**STEERED, "x": "0"}]))) == {"wheels[0].x"}


def test_duplicate_wheel_ids_are_errors() -> None:
    found = problems(data(wheels=[STEERED, {**OTHER, "id": "a"}]))
    assert list(found) == ["wheels"]
    assert "a" in found["wheels"]


def test_duplicate_wheel_ids_are_reported_beside_other_mistakes() -> None:
    found = problems(data(wheels=[STEERED, {**OTHER, "id": "a", "max_speed": -1}]))
    assert set(found) == {"wheels", "wheels[1].max_speed"}


@pytest.mark.parametrize(
    ("wheels", "words"),
    [
        (
            [
                {"id": "front", "type": "fixed", "x": 0.5, "y": 0, "max_speed": 1},
                {"id": "rear", "type": "fixed", "x": -0.5, "y": 0, "max_speed": 1},
            ],
            ["front", "rear", "parallel", "cannot turn"],
        ),
        (
            [
                {"id": "l", "type": "fixed", "x": 0, "y": 0.5, "max_speed": 1},
                {"id": "r", "type": "fixed", "x": 0, "y": -0.5, "heading_deg": 30},
            ],
            ["l", "r", "cross"],
        ),
        (
            [
                {
                    "id": "m",
                    "type": "mecanum",
                    "x": 0.5,
                    "y": 0,
                    "max_speed": 1,
                    "roller_deg": 45,
                },
                {"id": "s", "type": "steered", "x": -0.5, "y": 0, "max_speed": 1},
            ],
            ["m (mecanum)", "driven standard wheel s"],
        ),
        (
            [{"id": "c", "type": "castor", "x": 0.5, "y": 0}],
            ["castor"],
        ),
        (
            [
                {"id": "w{0}", "type": "fixed", "x": 0.5, "y": 0, "max_speed": 1},
                {"id": "%s", "type": "fixed", "x": -0.5, "y": 0, "max_speed": 1},
            ],
            ["parallel", "%s"],
        ),
    ],
    ids=["parallel", "crossing", "mecanum-driven", "castors", "odd-ids"],
)
def test_wheels_that_cannot_move_together_are_named(
    wheels: list[dict[str, object]], words: list[str]
) -> None:
    text = problems(data(wheels=wheels))["wheels"]
    for word in words:
        assert word in text


def test_all_wheels_at_k_need_a_boundary_curvature() -> None:
    at_k = data(wheels=[{**STEERED, "x": 0, "y": 0}])
    assert "must be given" in problems(at_k)["kappa_g"]
    vehicle = configspace.vehicle_from_data({**at_k, "kappa_g": 2.5})
    assert vehicle.boundary_curvature == 2.5


# --- files


def assert_unusable(text: str, *words: str) -> None:
    with pytest.raises(configspace.InvalidVehicle) as caught:
        configspace.parse_vehicle(text)
    for word in words:
        assert word in str(caught.value)


def test_syntax_errors_name_the_line() -> None:
    assert_unusable("name: agv\nwheels:\n  - {id: a, x: [1, 2}\n", "line 3")
    assert_unusable('{"name": "agv",\n"wheels": [\n', "line 3")
    assert_unusable("name: agv\n\twheels: []", "line 2")


def test_repeated_keys_are_errors() -> None:
    assert_unusable("name: a\nname: b\nwheels: []", "line 2", "'name' stands twice")
    assert_unusable('{"name": "a", "wheels": [{"x": 1, "x": 2}]}', "'x' stands twice")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "   \n",
        "# only a comment",
        "---\n---\nname: a",
        "[" * 5000,
        "{" * 5000,
        "\x00\x01\x02",
        "name: !!python/object/apply:os.getcwd []",
        "name: &a [*a]\nwheels: []",
        "name: a\nwheels: &w\n  - *w",
        "2020-01-01: 1",
        "? [a, b]\n: 1",
        "1: 2",
        "~: 2",
        "!!binary aGk=: 1",
        "name: 2020-01-01\nwheels: [1]",
        "name: !!set {a, b}\nwheels: []",
        "a: " + "9" * 5000,
        '"\\ud800": 1',
        "name: '\\ud800'\nwheels: 3",
        "- " * 2000,
    ],
)
def test_odd_texts_are_plain_errors(text: str) -> None:
    assert_unusable(text)


def test_odd_data_is_a_plain_error() -> None:
    deep: list[object] = []
    for _ in range(100_000):
        deep = [deep]
    loop: dict[str, object] = {"name": "a"}
    loop["wheels"] = loop
    for given in (data(name=deep), {(1, 2): 3}, loop, data(name={1, 2}), {None: 1}):
        problems(given)


def test_files_that_cannot_be_read_are_plain_errors(tmp_path: Path) -> None:
    binary = tmp_path / "vehicle.yaml"
    binary.write_bytes(bytes(range(256)))
    empty = tmp_path / "empty.yaml"
    empty.write_bytes(b"")
    utf16 = tmp_path / "utf16.yaml"
    utf16.write_bytes("name: a".encode("utf-16"))
    for path in (binary, empty, utf16, tmp_path, tmp_path / "none.yaml"):
        with pytest.raises(configspace.InvalidVehicle):
            configspace.load_vehicle(path)


@pytest.mark.parametrize("name", ["no-such", "", "a\0b", "x" * 5000, "~nobody/x"])
def test_unknown_names_are_plain_errors(name: str) -> None:
    with pytest.raises(configspace.InvalidVehicle):
        configspace.load_vehicle(name)


def test_a_missing_vehicle_lists_the_catalogue() -> None:
    with pytest.raises(configspace.InvalidVehicle, match="ift-four-steered"):
        configspace.load_vehicle("ift-four-wheels")


def test_files_may_start_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = tmp_path / "agv.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + yaml.safe_dump(data()).encode())
    assert configspace.load_vehicle(path).name == "agv"


def test_the_subject_is_named(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("name: a\nwheels: [{}, {}]\n")
    with pytest.raises(configspace.InvalidVehicle, match=r"mine\.yaml") as caught:
        configspace.load_vehicle(path)
    assert "mine.yaml" in caught.value.subject


def test_schema_describes_every_key() -> None:
    schema = configspace.vehicle_schema()
    assert set(schema["properties"]) == set(Vehicle.model_fields)
    assert schema["additionalProperties"] is False
    json.dumps(schema)


LINE = data(wheels=[STEERED, FIXED])
SYNCHRO = data(synchro=True)
BETA, KAPPA = "guaranteed.beta_rate_deg", "guaranteed.kappa_rate"


@pytest.mark.parametrize(
    ("given", "where", "said"),
    [
        (
            {**LINE, "guaranteed": {"beta_rate_deg": 20.5}},
            BETA,
            "20.5; 0 or left out: the fixed wheel f keeps β constant",
        ),
        (
            {**SYNCHRO, "guaranteed": {"kappa_rate": 0.2, "beta_rate_deg": 5.0}},
            KAPPA,
            "0.2; 0 or left out: a synchro drive cannot leave κ_n = 0",
        ),
    ],
)
def test_rates_that_no_configuration_has_cannot_be_guaranteed(
    given: dict[str, object], where: str, said: str
) -> None:
    assert problems(given) == {where: said}
    # Together with mistakes of values and with other conflicts.
    mistakes: dict[str, object] = {"name": "No Name", "kappa_g": -1}
    assert set(problems({**given, **mistakes})) == {where, *mistakes}
    polygon: dict[str, object] = {"footprint": [[0, 0], [1, 0]]}
    both = problems({**given, **polygon})
    assert set(both) == {where, "footprint"}


def test_rates_that_the_undercarriage_has_may_be_guaranteed() -> None:
    both = {"kappa_rate": 0.2, "beta_rate_deg": 10.0}
    configspace.vehicle_from_data(data(guaranteed=both))
    still = {**both, "beta_rate_deg": 0.0}
    configspace.vehicle_from_data(data(wheels=[STEERED, FIXED], guaranteed=still))
    still = {**both, "kappa_rate": 0.0}
    configspace.vehicle_from_data(data(synchro=True, guaranteed=still))


def test_conflicts_of_every_kind_come_together() -> None:
    second = {**FIXED, "x": 1.0}
    found = problems(
        {
            "name": "agv",
            "wheels": [FIXED, second],
            "footprint": [[0, 0], [1, 0]],
            "limits": {"lateral_acceleration_at": "center_of_gravity"},
            "guaranteed": {"beta_rate_deg": 10},
        }
    )
    assert set(found) == {
        "wheels",  # repeated ids, and parallel axles
        "footprint",
        "limits.lateral_acceleration_at",
        "guaranteed.beta_rate_deg",
    }
