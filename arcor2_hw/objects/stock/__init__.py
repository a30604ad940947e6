"""Stock object types for programs: flow, logic, time, random numbers and counters. They are ordinary object types."""
