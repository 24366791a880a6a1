"""Other ways to the fastest motion along a line, beside brachis: ``python benchmarks/peers/run.py``."""
