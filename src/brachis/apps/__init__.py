"""Applications that use a motion: figures, reports, exports, comparisons, sweeps, and the command line."""
