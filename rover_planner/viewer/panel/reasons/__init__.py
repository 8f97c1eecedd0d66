"""What the panels say of reasons: lanes of limits, the failure, candidates, before and after."""
