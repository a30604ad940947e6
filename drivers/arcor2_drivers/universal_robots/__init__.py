"""Universal Robots arms, e-series and CB3, via ur_rtde and the dashboard server."""
