"""What the page shows, as data: session, journey, clock, layers, requests of visitors."""
