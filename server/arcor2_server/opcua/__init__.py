"""The connection to the process of the OPC UA server, through which plant systems read and command the cell."""
