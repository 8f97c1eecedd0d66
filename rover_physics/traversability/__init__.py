"""What a prediction means: limits, verdicts, classes, traps and reach."""
