"""What holds a motion back."""
