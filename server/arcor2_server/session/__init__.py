"""The open scene or project: its content, its checks, its journal."""
