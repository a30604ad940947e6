"""The first day with a real device: a session that a person confirms step by step, and its report."""
