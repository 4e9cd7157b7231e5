"""What every server needs: settings, error table, health, metrics, one-loop server."""
