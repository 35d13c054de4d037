"""What `import wavesim as ws` offers, for editors: completions and types."""

from wavesim import layered as layeredwave
from wavesim import planewave
from wavesim.case.load import load
from wavesim.differentiable.stack_transmission import transmission as traced_transmission
from wavesim.differentiable.traced_layers import traced_layers
from wavesim.grid.bar import Bar, layered_bar
from wavesim.material.damping import Damping, constant_quality
from wavesim.material.family import Block, Family
from wavesim.material.layers import Layer, Layers
from wavesim.material.medium import FluxForm, Medium, Parameter
from wavesim.material.several_families import together
from wavesim.readings.bar.reading import read_bar
from wavesim.readings.dispersion.extract import extract
from wavesim.readings.dispersion.frequency_at_wavenumber import in_time
from wavesim.readings.dispersion.wavenumber_at_frequency import in_space
from wavesim.readings.matched_record import matched
from wavesim.readings.pulse.array_reading import read_array as read_pulses
from wavesim.readings.pulse.measurement import measure as measure_pulses
from wavesim.readings.pulse.one_receiver import read_one as read_transmission
from wavesim.readings.pulse.series_reading import read_series
from wavesim.readings.pulse.transmission_record import transmission_record
from wavesim.records.arrays import Layout
from wavesim.records.files import read as read_record
from wavesim.records.inspection import inspect
from wavesim.records.of_pulse_test import of_pulse_file as read_pulse_test
from wavesim.records.record import record
from wavesim.records.run_folder import open_run as open
from wavesim.records.synthetic import synthesize
from wavesim.report.progress import part_done as progress
from wavesim.simulation.field import Field
from wavesim.simulation.simulation import Simulation
from wavesim.sources import Chirp, GaussianDerivative, InitialField, Recorded, Ricker, ToneBurst
from wavesim.studies.comparison import compare
from wavesim.studies.fit_answer import of_waveforms as fit_waveforms
from wavesim.studies.medium_fit import fit
from wavesim.studies.sweep import sweep
from wavesim.timedomain.gradient import traced_fields
from wavesim.timedomain.integrate import integrate, simulate
from wavesim.verdict.bar import judge_bar
from wavesim.verdict.branches import hold
from wavesim.verdict.endless import judge
from wavesim.verdict.score import score as score

__all__ = [
    "Bar",
    "Block",
    "Chirp",
    "Damping",
    "Family",
    "Field",
    "FluxForm",
    "GaussianDerivative",
    "InitialField",
    "Layer",
    "Layers",
    "Layout",
    "Medium",
    "Parameter",
    "Recorded",
    "Ricker",
    "Simulation",
    "ToneBurst",
    "compare",
    "constant_quality",
    "extract",
    "fit",
    "fit_waveforms",
    "hold",
    "in_space",
    "in_time",
    "inspect",
    "integrate",
    "judge",
    "judge_bar",
    "layered_bar",
    "layeredwave",
    "load",
    "matched",
    "measure_pulses",
    "open",
    "planewave",
    "progress",
    "read_bar",
    "read_pulse_test",
    "read_pulses",
    "read_record",
    "read_series",
    "read_transmission",
    "record",
    "simulate",
    "sweep",
    "synthesize",
    "together",
    "traced_fields",
    "traced_layers",
    "traced_transmission",
    "transmission_record",
]

__version__: str
