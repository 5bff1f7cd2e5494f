import pickle

import pytest

from configspace.errors import InvalidInput, InvalidVehicle, OmniplanError, Problem

ONE = Problem("wheels[2].x", "-1", "must be positive")
TWO = Problem("name", "missing", "must be given")


def test_message_says_where_what_and_what_is_allowed() -> None:
    assert str(InvalidInput(ONE)) == "wheels[2].x: -1; must be positive"
    assert str(InvalidInput(ONE, "file a.yaml")).startswith("file a.yaml: wheels[2].x")


def test_all_problems_are_in_the_message_and_kept() -> None:
    error = InvalidVehicle(iter([ONE, TWO]), "file a.yaml")
    assert error.problems == (ONE, TWO)
    assert error.subject == "file a.yaml"
    assert "2 problems" in str(error)
    for problem in (ONE, TWO):
        assert str(problem) in str(error)


def test_bad_input_is_caught_as_value_error_and_by_the_root() -> None:
    for base in (ValueError, OmniplanError, InvalidInput):
        with pytest.raises(base):
            raise InvalidVehicle(ONE)


def test_errors_survive_pickling() -> None:
    error = pickle.loads(pickle.dumps(InvalidVehicle([ONE, TWO], "file a.yaml")))
    assert error.problems == (ONE, TWO)
