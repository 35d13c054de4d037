"""What an experimenter reads from a pulse-transmission test.

Signals of a few receivers in, results out. No grid, no medium and no theory enters.

    measurement.measure        all that follows at once, from {name: signal}, {name: position}
    pulserecord.PulseRecord    checked signals, with the noise before the first arrival
    arrivals                   first break, threshold, envelope peak, cross-correlation
    velocity                   velocity from arrivals at several distances
    windows                    time gate, exponential window; spectra through either
    phasevelocity              complex k(ω), phase and group velocity, attenuation, Q
    spectralratio              α(ω) and constant Q from amplitudes alone
    loss                       transmission loss between two receivers
    pulsefigures               figures of them
"""
