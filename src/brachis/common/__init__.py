"""Common tools of all other parts: arguments, arrays, files, deadlines, interrupts, progress, summaries."""
