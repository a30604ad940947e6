"""Universal Robots arms: e-series and CB3, through ur_rtde and the dashboard server."""
