"""Support of the tests of the page."""
