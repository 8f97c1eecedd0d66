"""The panels beside the scene: tabs, buttons, dashboard and plots."""
