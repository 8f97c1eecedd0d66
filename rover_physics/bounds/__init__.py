"""What an uncertain map leaves open: bounds on all that is predicted."""
