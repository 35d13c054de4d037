"""One contestant in this process: its times, from the start of the process, as one line of JSON.

    python measure.py '{"module": …, "cls": …, …}'     (run.py calls it)

Cold is the first run of the process, up to all frames in memory: start and imports, set-up,
compilation, steps. Warm are further runs in it with another medium, set-up included.
Steps of more than 20 s are not run again: warm then is the other medium's set-up, and these steps.
"""

from __future__ import annotations

import importlib
import json
import sys
import time
from typing import Any

# Warm runs: this many, or fewer once they have taken so many seconds.
_WARM, _ENOUGH = 5, 5.0
_LONG = 20.0


def main(asked: dict[str, Any]) -> None:
    contestant = getattr(importlib.import_module(asked["module"]), asked["cls"])
    imported = time.monotonic()

    def prepared(other: bool) -> tuple[Any, float]:
        """A contestant set up and compiled, and the seconds that it took."""
        begun = time.monotonic()
        if asked["module"] == "peers.wavesim_call":
            peer = contestant(asked["problem"], asked["setting"], other)
        else:
            import numpy as np
            from peers.given import Given

            with np.load(asked["given"][other]) as file:
                peer = contestant(Given(file), asked["setting"])
        if hasattr(peer, "compile"):
            peer.compile(asked["frames"])
        return peer, time.monotonic() - begun

    def timed(other: bool) -> tuple[Any, Any, dict[str, float]]:
        peer, preparing = prepared(other)
        begun = time.monotonic()
        found = peer.run(asked["frames"])
        running = time.monotonic() - begun
        within = getattr(peer, "prepared", 0.0)  # wavesim tells what its call has spent so
        return peer, found, {"prepare": preparing + within, "steps": running - within}

    peer, found, cold = timed(False)
    cold["imports"] = imported - asked["begun"]
    if asked["keep"]:
        import numpy as np

        np.save(asked["keep"], getattr(peer, "stacked", lambda frames: frames)(found))
    warm: list[dict[str, float]] = []
    if asked["warm"] and cold["steps"] > _LONG:
        asked["warm"] = False
        warm = [{"prepare": prepared(True)[1], "steps": cold["steps"]}]
    while asked["warm"] and len(warm) < _WARM and sum(sum(one.values()) for one in warm) < _ENOUGH:
        del peer, found
        peer, found, one = timed(True)
        warm.append(one)
    print(json.dumps({"cold": cold, "warm": warm}))


if __name__ == "__main__":
    main(json.loads(sys.argv[1]))
