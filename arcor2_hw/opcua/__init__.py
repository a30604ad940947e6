"""The OPC UA server of the cell, in a process of its own: information models, values, alarms, users, commands."""
