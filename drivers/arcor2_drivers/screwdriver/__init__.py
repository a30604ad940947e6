"""Screwdrivers and other tightening tools by Open Protocol (docs/devices/screwdriver.md)."""
