"""ABB YuMi (IRB 14000): two arms, by Robot Web Services and a RAPID motion server per arm."""
