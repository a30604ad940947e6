"""Stock object types for programs: flow, logic, time, chance and counting. Ordinary types, one module each."""
