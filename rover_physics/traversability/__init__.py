"""Assessment of predictions: limits, verdicts, traversability classes, entrapment and reach."""
