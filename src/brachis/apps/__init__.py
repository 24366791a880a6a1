"""What is done with a motion: figures, reports, exports, comparisons, sweeps, and the command line."""
