"""Fakes of devices, one per module and process. They share nothing with the product except the wire protocols."""
