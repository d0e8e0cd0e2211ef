"""Uncertainty of the estimate: budget or repetitions → covariance of the readings → GUM framework and Monte Carlo.

inputs.py + sources/   what disturbs the readings, one file a source → covariance of the n gaps and m known distances
pooled.py              the same from repeated cycles and days (thesis chapters 5 and 8)
study.py               gain of the estimate; propagation, correlation, budget (JCGM 100, 102)
trials.py, _batch.py   Monte Carlo of the whole nonlinear estimation (JCGM 101, 102)
coverage.py            intervals, joint regions, numerical tolerance, validation, adaptive procedure
process.py             is a difference one? strategies, remounts, indexations, cycles, days
analysis.py            all of it for a cell; fleet.py spreads the trials over a cluster
"""
