"""The data of the page: session, trajectory, playback, layers, colours, requests of visitors."""
