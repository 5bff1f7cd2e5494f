"""Names that the tests of the service share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import configspace
import omniplan
from services.wire.exchange import Reply

ANY_PORT = "tcp/127.0.0.1:0"
ANY_TLS_PORT = "tls/127.0.0.1:0"
Ask: TypeAlias = Callable[..., list[Reply]]
Fleet: TypeAlias = Sequence[configspace.PermissibleSpace]
Trajectories: TypeAlias = Sequence[omniplan.Trajectory]
