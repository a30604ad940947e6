"""ABB YuMi (IRB 14000): two arms, via Robot Web Services and a RAPID motion server per arm."""
