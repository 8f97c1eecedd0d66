"""Pictures: answers on the map, and Figure 4 of the paper."""
