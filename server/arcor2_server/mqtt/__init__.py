"""The connection to the process of the MQTT clients, through which plant systems receive the state of the cell."""
