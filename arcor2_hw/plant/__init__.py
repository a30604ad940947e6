"""What the processes that show the cell to plant systems have in common: the data of the cell, and their connection."""
