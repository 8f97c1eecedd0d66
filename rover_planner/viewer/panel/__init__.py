"""The panel beside the scene: tabs, buttons, board and plots."""
