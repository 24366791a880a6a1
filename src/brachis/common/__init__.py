"""What every other part stands on: arguments, arrays, files, deadlines, interrupts, progress, summaries."""
