"""What an answer of the service must be, by its request alone.

The service's own readers are not used: JSON is read by Python, Arrow by pyarrow.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
from odd_requests import Question

import configspace
import omniplan
from omniplan.batch.many import SCHEMA
from services.errors import CODES
from services.protocol.batch_messages import BatchPart
from services.protocol.messages import (
    ErrorReply,
    SelectReply,
    ValidateReply,
    decode,
    encode,
)
from services.registering.registry_messages import RegisterReply
from services.wire.exchange import Reply


def written(data: Any) -> str:
    return json.dumps(data, sort_keys=True)


def read_motions(items: list[Any]) -> list[omniplan.Trajectory]:
    return [omniplan.Trajectory.from_dict(item) for item in items]


@dataclass
class Judge:
    """Knows what is right, from the request alone and without the service's readers."""

    spaces: dict[str, configspace.PermissibleSpace]
    changes: list[RegisterReply] = field(default_factory=list)

    def check(self, question: Question, replies: list[Reply]) -> str:
        """Return the code of an answer; AssertionError for a wrong one."""
        for reply in replies:
            if reply.is_error:
                error = decode(ErrorReply, reply.payload)
                assert error.code in CODES
                assert error.code != "internal"
                assert 0 < len(error.message) <= 4000
        if not question.is_answered:
            return "any"
        assert replies, "no answer"
        if replies[-1].is_error:
            return decode(ErrorReply, replies[-1].payload).code
        assert question.verb.startswith("batches/") or len(replies) == 1
        check = {
            "validate": self._check_validate,
            "select": self._check_select,
            "batches/validate": self._check_batch,
            "batches/twists": self._check_twists,
        }.get(question.verb)
        if check is not None:
            assert question.payload is not None
            check(question.payload, replies)
        elif question.verb.startswith(("register/", "unregister/")):
            change = decode(RegisterReply, replies[0].payload)
            assert change.id == question.verb.partition("/")[2]
            self.changes.append(change)
        return "ok"

    def _check_validate(self, payload: bytes, replies: list[Reply]) -> None:
        asked = json.loads(payload)
        space = self.spaces[asked["vehicle"]]
        allow = asked.get("allow_unreachable", False)
        reports = [
            omniplan.validate(motion, space, allow_unreachable=allow)
            for motion in read_motions(asked["trajectories"])
        ]
        assert replies[0].payload == encode(ValidateReply.of(reports))

    def _check_select(self, payload: bytes, replies: list[Reply]) -> None:
        asked = json.loads(payload)
        names = asked.get("vehicles")
        fleet = [self.spaces[n] for n in (self.spaces if names is None else names)]
        rankings = [
            omniplan.select(
                [motion],
                fleet,
                by=asked.get("by", "duration"),
                requirements=asked.get("requirements", ()),
                allow_unreachable=asked.get("allow_unreachable", False),
            )[0]
            for motion in read_motions(asked["trajectories"])
        ]
        expected = [ranking.to_dict() for ranking in rankings]
        given = [r.to_dict() for r in decode(SelectReply, replies[0].payload).values()]
        if names is None:
            # All that the server knew in that moment: also what was registered.
            given = [self._only_fixed(ranking) for ranking in given]
        assert written(given) == written(expected)

    def _only_fixed(self, ranking: dict[str, Any]) -> dict[str, Any]:
        lists = {
            name: [x for x in ranking[name] if x["vehicle"] in self.spaces]
            for name in ("suitable", "refused", "unfit")
        }
        return {**ranking, **lists}

    def _rows(self, replies: list[Reply]) -> pa.Table:
        """Return the rows of all parts, whose numbers must be in order."""
        done = 0
        tables = []
        for index, reply in enumerate(replies):
            table = pa.ipc.open_stream(reply.payload).read_all()
            part = decode(BatchPart, table.schema.metadata[b"omniplan"])
            assert (part.sequence, part.first) == (index, done)
            done += table.num_rows
            assert part.done == done
            assert part.is_last == (reply is replies[-1]) == (done == part.total)
            tables.append(table.replace_schema_metadata(None))
        return pa.concat_tables(tables)

    def _read(self, payload: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
        with pa.ipc.open_stream(payload) as reader:
            table = reader.read_all()
        table.validate(full=True)
        asked = json.loads(table.schema.metadata[b"omniplan"])
        return asked, {name: table[name].to_numpy() for name in table.column_names}

    def _check_batch(self, payload: bytes, replies: list[Reply]) -> None:
        asked, columns = self._read(payload)
        t = columns["t"].astype(float)
        names = columns.get("trajectory", np.full(t.size, "trajectory", dtype=object))
        point = np.zeros((t.size, 2))
        if "reference_x" in columns:
            point = np.column_stack([columns["reference_x"], columns["reference_y"]])
        motions = []
        for name in dict.fromkeys(names):
            mine = names == name
            form = ("x", "y", "theta") if "x" in columns else ("vx", "vy", "omega")
            rows = np.column_stack([columns[c][mine].astype(float) for c in form])
            make = (
                omniplan.Trajectory.from_poses
                if "x" in columns
                else omniplan.Trajectory.from_twists
            )
            where = tuple(point[mine][0].tolist())
            motions.append(make(t[mine], rows, name=name, reference_point=where))
        chosen = asked.get("vehicles")
        fleet = [self.spaces[n] for n in (self.spaces if chosen is None else chosen)]
        allow = asked.get("allow_unreachable", False)
        expected = omniplan.validate_many(motions, fleet, allow_unreachable=allow)
        given = self._rows(replies).cast(SCHEMA).to_pylist()
        given = [row for row in given if row["vehicle"] in self.spaces]
        assert written(given) == written(expected.to_pylist())

    def _check_twists(self, payload: bytes, replies: list[Reply]) -> None:
        asked, columns = self._read(payload)
        twists = np.column_stack([columns[c] for c in ("vx", "vy", "omega")])
        expected = omniplan.check_twists(twists, self.spaces[asked["vehicle"]])
        given = self._rows(replies)["permitted"].to_numpy()
        assert np.array_equal(given, expected)
