"""The audit trail: who changed or commanded what, when and from where, in a file that reveals later edits."""
