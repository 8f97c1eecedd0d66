"""Publishers that make messages for those who listen."""
