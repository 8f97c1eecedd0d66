"""Plans ways between two poses around obstacles, and explains where there is none."""
