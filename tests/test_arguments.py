"""What a caller gives wrong is one ValueError that names key, value and what is allowed."""

import pickle

import numpy as np
import pytest

import wavesim as ws

MEDIUM = ws.Medium(closure="consistent", anisotropy=0.25)
BAR = ws.Bar(cells=64, spacing=1.25e-4)
PULSE = ws.Ricker("phi1", 0.004, 4e5)
WRONG = (
    1 + 2j,
    b"x",
    float("nan"),
    True,
    object(),
    10**400,
    np.full((2, 3), np.nan),
    np.array([b"x"]),
)
CALLS = [
    (ws.Bar, {"cells": 64, "spacing": 1e-4}),
    (ws.layered_bar, {"layers": ws.Layers((ws.Layer(0.0, 0.02, MEDIUM),)), "spacing": 1.25e-4}),
    (ws.Medium, {"anisotropy": 0.2, "density": 1e3, "damping": ws.Damping(), "closure": "printed"}),
    (ws.Layer, {"start": 0.0, "end": 1e-3, "medium": MEDIUM}),
    (ws.Layers, {"layers": (ws.Layer(0.0, 0.02, MEDIUM),)}),
    (ws.Ricker, {"field": "phi1", "position": 0.004, "peak_frequency": 4e5}),
    (ws.ToneBurst, {"field": "phi1", "position": 0.004, "frequency": 4e5, "cycles": 5}),
    (ws.Damping, {"mass": 1.0}),
    (ws.constant_quality, {"quality": 20.0, "band": (1e4, 1e6)}),
    (ws.simulate, {"medium": MEDIUM, "bar": BAR, "sources": [PULSE], "duration": 2e-5}),
    (ws.record, {"values": np.zeros((64, 8)), "t": np.arange(64.0), "x": np.arange(8.0)}),
    (ws.planewave.frequencies, {"medium": MEDIUM, "sector": "longitudinal", "k": [100.0]}),
    (ws.read_record, {"path": "record.npz"}),
    (ws.load, {"path": "slab"}),
    (ws.open, {"folder": "out"}),
]


@pytest.mark.parametrize(("call", "given"), CALLS, ids=[call.__name__ for call, _ in CALLS])
def test_a_wrong_argument_is_named_with_what_is_allowed(call, given):
    """Each argument in turn as a thing of no sense; a keyword misspelt by one letter."""
    for key in given:
        for wrong in WRONG:
            with pytest.raises(ValueError) as caught:  # noqa: PT011
                call(**given | {key: wrong})
            assert key in str(caught.value), (key, wrong)
            assert len(str(caught.value).splitlines()) == 1
    key = next(iter(given))
    with pytest.raises(ValueError, match=f"{key}x: is no argument.*did you mean {key}"):
        call(**given, **{f"{key}x": 1})


def test_a_ring_is_for_extract_and_layers_are_for_read_bar():
    field = ws.simulate(MEDIUM, BAR, [PULSE], 2e-5, samples=17)
    with pytest.raises(ValueError, match=r"field: of a ring of one medium.*take extract"):
        ws.read_bar(field)
    with pytest.raises(ValueError, match="damping = -1: must be between 4 and 30"):
        ws.extract(field, damping=-1.0)
    with pytest.raises(ValueError, match=r"name = 'zz'.*must be one of"):
        field.at(0.001, "zz")


def test_public_functions_travel_between_processes():
    assert pickle.loads(pickle.dumps(ws.simulate)) is ws.simulate
